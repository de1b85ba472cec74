"""Sweeps: many runs of one family of scenarios, kept as they finish, measured and set against each other."""
