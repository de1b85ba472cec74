"""Claims about runs: hypotheses, conclusions, verdicts, and judgements over many runs."""
