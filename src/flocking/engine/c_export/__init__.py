"""Export of a control law as C99 for a flight computer."""
