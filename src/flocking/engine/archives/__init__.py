"""Arrays and numbers in one file, and checks of data read from disk."""
