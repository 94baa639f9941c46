"""Fault campaign: seeded flights with faults in every state of the landing (`python -m tests.campaign`)."""
