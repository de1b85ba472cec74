"""The scene of the lab: agents, obstacles, leaders, and the camera."""
