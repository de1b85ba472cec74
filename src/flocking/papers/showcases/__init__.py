"""Large runs in the gallery: scenario files, stored summaries of their runs, and pictures."""
