"""Held control and messages: motion in closed form from event to event, without an integrator."""
