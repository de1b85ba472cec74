"""Sweeps: many runs of a parametrised scenario, stored as they finish, measured and compared."""
