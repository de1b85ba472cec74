"""Runs: what a simulation leaves behind, the columns of its records, and how two runs differ."""
