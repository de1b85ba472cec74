"""What the lab draws: agents, obstacles, leaders, and the view of them."""
