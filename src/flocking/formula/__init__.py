"""Text formulas, their SymPy form, and compiled functions made from it."""
