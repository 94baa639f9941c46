"""Live view for engineers: the visual topics of a recording over Foxglove's WebSocket."""
