"""Steps on which nothing switches and nothing is in doubt, many in one native call."""
