"""The live lab: a page in which a running scenario can be changed, with a log of all changes."""
