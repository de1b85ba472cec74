"""Applications: the command line, the reproduction of the papers, the live lab."""
