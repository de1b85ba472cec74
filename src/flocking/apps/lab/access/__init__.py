"""Who may use the lab: checks of requests, and the folder it is confined to."""
