"""Pictures: nets in the plane, time series, animations, in one style; independent of the papers."""
