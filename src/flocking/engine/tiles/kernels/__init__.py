"""The generated kernel of one time step: specification, printing, parameters and sums per tile."""
