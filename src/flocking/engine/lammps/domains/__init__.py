"""The kernels of the tiled engine on many processes: each has the agents of a domain of space, and copies near it."""
