"""Engine for bodies in discrete time: velocities set at ticks, straight motion between them."""
