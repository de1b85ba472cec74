"""What claims measure, and why they cannot be asked of some runs, by subject."""
