"""Shared parts of the engines with a fixed time step: choice of the step and checks of it."""
