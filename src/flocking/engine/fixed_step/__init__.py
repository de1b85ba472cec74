"""What the engines with a fixed time step share: the choice of the step and checks of it."""
