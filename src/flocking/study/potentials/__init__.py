"""Analysis of potentials: the definitions of the papers, shapes, equilibria and nonsmooth points."""
