"""One operating-system process an agent, which hears of the others only by messages, and a process for the world."""
