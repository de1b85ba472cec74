"""Interaction graphs: who is a neighbour of whom, with which weight, and what the links are together."""
