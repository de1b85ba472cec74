"""Held control and messages: motion from event to event, in closed form where bodies have one."""
