"""What is guaranteed of a scenario before it runs, each with its theorem, its hypotheses and an enclosed number."""
