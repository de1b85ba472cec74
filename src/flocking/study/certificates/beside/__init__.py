"""What is guaranteed before a run, beside what is judged and measured afterwards."""
