"""The exact engine: adaptive steps of order 8 that end at every switch of a link."""
