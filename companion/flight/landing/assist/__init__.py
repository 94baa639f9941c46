"""Assist: a target for the landings that the autopilot makes by itself, and what landing here now means."""
