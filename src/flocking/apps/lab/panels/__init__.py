"""The panels of the page: controls, measurements, interventions, saving."""
