"""An integrator of the motion of a few agents that shares no code with the library it judges."""
