"""Settings shared by all tests: one profile for drawn examples, and no slow sessions by accident."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

settings.register_profile(
    "project",
    deadline=None,  # the first example of a structure generates its functions
    derandomize=True,
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("project")
