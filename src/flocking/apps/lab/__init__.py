"""The live lab: a page in which a scenario runs, can be changed as it does, and is put on record."""
