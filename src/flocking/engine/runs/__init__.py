"""The result of a simulation, the columns of its records, and comparison of two runs."""
