"""Breaks the home of every row of the equation tables and lists what the row's test does not notice.

``python -m tests.papers.broken`` runs it; see `tests.papers.broken.__main__`.
"""
