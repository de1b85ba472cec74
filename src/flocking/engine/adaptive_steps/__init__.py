"""Dormand and Prince of order 8: stages, steps, and each step as a polynomial in time."""
