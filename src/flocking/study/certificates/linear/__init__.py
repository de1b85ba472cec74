"""Guarantees of linear consensus on directed graphs, and on graphs that switch."""
