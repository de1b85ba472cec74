"""Ground floor: text formulas, their SymPy form, and compiled functions made from it."""
