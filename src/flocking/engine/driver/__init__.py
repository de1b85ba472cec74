"""From a scenario to a run: simulate, save, resume; the only folder that imports both engines and storage."""
