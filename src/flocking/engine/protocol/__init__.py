"""The interface of all engines: an entry with a name and options, and sessions that advance."""
