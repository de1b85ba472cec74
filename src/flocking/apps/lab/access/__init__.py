"""Access to the lab: checks of requests, and the folder it is confined to."""
