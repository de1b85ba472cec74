"""Blocks of steps in one native call, up to the first that ends in a switch or leaves something in doubt."""
