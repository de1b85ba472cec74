"""Held control in the tiled engine: forces that change at ticks, and what agents know of each other."""
