"""Open pages: frames and measurements go out, orders come in."""
