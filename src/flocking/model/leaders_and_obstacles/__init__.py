"""Virtual leaders and obstacles."""
