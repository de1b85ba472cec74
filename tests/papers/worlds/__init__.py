"""Worlds that claims of papers are about."""
