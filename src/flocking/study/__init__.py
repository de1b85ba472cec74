"""WHAT IT MEANS: nets, claims, audits, scenario files."""
