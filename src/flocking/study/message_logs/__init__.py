"""What agents used when they acted, computed a second time from the log of a run."""
