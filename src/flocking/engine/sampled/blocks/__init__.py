"""The native loop over the events of a session of held control."""
