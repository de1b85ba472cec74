"""A running experiment without a page: events, settings, clock and history."""
