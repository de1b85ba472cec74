"""Large runs shown in the gallery: scenario files, what is kept of a run of theirs, and pictures of it."""
