"""Held control with samples that are late."""
