"""Runs on disk: atomic files, the Zarr layout, reading, writing, and formats of other programs; knows no engine."""
