"""`slz doctor`: preflight checks of vehicle, sensor and computer, each with a remedy."""
