"""One operating-system process an agent, which has states of the others only by messages, and one for the world."""
