"""Particle arrays: agents in sorted order, the numbers and radii of their law, and their displacements."""
