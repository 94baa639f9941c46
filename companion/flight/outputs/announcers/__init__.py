"""What was found, as texts for the pilot."""
