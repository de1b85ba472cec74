"""Potentials psi(r), bump functions, and the poles of a potential."""
