"""Messages under continuous control: what agents know is constant or linear in time from one arrival to the next."""
