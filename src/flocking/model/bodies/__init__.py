"""What agents can do: the columns of their state, how these change under a desired force, their kinetic energy."""
