"""WHAT is simulated: states, potentials, graphs, terms and laws. Formulas only, no time loop, no files."""
