"""Matrices, structure and rigidity of nets."""
