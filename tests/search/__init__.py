"""Rare-event search: adaptive search for unsafe touchdowns on cheap flights (`python -m tests.search`)."""
