"""Conclusions of claims, and the reasons why they do not apply to some runs."""
