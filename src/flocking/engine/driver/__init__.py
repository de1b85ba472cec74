"""From a scenario to a run: simulate, save, resume; the only folder that knows engines and storage."""
