"""Terms of a control law, the symbols they are stated in, and the balance of their energies."""
