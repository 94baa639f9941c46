"""Flight recordings (MCAP): all inputs for a replay, and topics for display."""
