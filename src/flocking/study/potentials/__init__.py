"""Analysis of potentials: definitions, shapes, equilibria and nonsmooth points."""
