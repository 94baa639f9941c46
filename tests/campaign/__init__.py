"""Faults in every state of the landing, many thousand seeded flights: `python -m tests.campaign`."""
