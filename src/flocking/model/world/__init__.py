"""The world around a law: when agents act, and what they know of each other."""
