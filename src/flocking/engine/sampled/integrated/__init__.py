"""Bodies that have no closed form under a held force: their equations are integrated from tick to tick."""
