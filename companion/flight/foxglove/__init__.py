"""Live view for engineers: the recording's topics for the eye, over Foxglove's WebSocket."""
