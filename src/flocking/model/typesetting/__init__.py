"""Laws and scenarios in symbols and words, derived from the formulas and the documentation of their parts."""
