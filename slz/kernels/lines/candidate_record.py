"""Record layout of a wire candidate: a return that may be of a wire."""

# EAST, NORTH, UP: place. SIGMA: standard deviation of the place (m). SEEN: time of its
# window (s). SENSOR: first of east, north and up of the sensor.
EAST, NORTH, UP, SIGMA, SEEN, SENSOR = range(6)
CANDIDATE_FIELDS = SENSOR + 3
