"""What agents can do: the columns of their state, how these change under a wanted force, their kinetic energy."""
