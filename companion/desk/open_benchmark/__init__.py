"""Open benchmark of safe maps: frozen scenes, a scorer for any system, methods from publications."""
