"""Formulas and texts as HTML that needs no font, script or network: MathML from LaTeX."""
