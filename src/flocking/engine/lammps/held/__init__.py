"""Held control and messages on many processes: the information of agents is sent and copied with them."""
