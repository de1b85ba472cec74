"""Certified crossings of distances and fields of view on one step, and the links that switch there."""
