"""Held control and messages on many processes: what agents know travels with them, and is copied where they are."""
