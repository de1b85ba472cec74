"""Pictures: nets in the plane, time series, animations, in one style. Draws runs, knows no paper."""
