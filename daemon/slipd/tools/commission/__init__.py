"""Leads a person from a config with guesses to a first grasp (``slipd commission``)."""
