"""How much imperfection of the world each conclusion about a law stands: quantities, search and table."""
