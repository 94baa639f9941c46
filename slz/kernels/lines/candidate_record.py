"""Record layout of a wire candidate: a return that may be of a wire."""

# EAST, NORTH, UP: place. SIGMA: standard deviation of the place (m). SEEN, WINDOW: time and number of its
# window. SENSOR: first of east, north and up of the sensor.
EAST, NORTH, UP, SIGMA, SEEN, WINDOW, SENSOR = range(7)
CANDIDATE_FIELDS = SENSOR + 3
