"""Cell list, neighbour lists and Verlet skin of the tiled engine."""
