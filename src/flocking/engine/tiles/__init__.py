"""The tiled engine: fixed steps, compiled kernels and neighbour lists in tiles, for a thousand to 10^8 agents."""
