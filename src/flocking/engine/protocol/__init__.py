"""What an engine is to everybody else: an entry with a name and options, and sessions that advance."""
