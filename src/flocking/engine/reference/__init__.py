"""The declared law on NumPy arrays, and laws that agents obey in its place."""
