"""The formulas of a law printed as code: parameter layout, expressions, obstacle formulas, and the generator."""
