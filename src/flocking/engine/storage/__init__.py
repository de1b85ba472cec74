"""Runs on disk: atomic files, Zarr layout, reading, writing, formats of other programs; independent of engines."""
