"""A font with a table of mathematics, for pages that stand alone."""
