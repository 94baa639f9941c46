"""Rare-event search: adaptive search for unsafe touchdowns, on flights in memory (`-m tests.search`)."""
