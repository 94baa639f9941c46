"""Record layout of an isolated return, which is kept from window to window."""

# EAST, NORTH, UP: place, in the heights of the evidence. BORN: time of its window (s). SENSOR_UP: height of
# the sensor then. NUMBER: ascending in the order of all windows. DISTANT: beyond the reach of the map. HELD:
# rays per m2 that the cells around hold; RAYS: the same, with those that the cells forgot. OVER: height over
# ground, as last known. BAND: of height over ground, `NO_BAND` before ground was known, and of those that go
# before they are judged. LONELY: without another near. FOUND: counts as an object; WAS_FOUND: did so after
# the last window. FATE: whether it stays, or why it goes. UPRIGHT, LEVEL: first of `MOST_OTHERS` horizontal
# distances of others, ascending, infinite where there is none.
(
    EAST, NORTH, UP, BORN, SENSOR_UP, NUMBER, DISTANT, HELD, RAYS, OVER, BAND, LONELY, FOUND, WAS_FOUND, FATE,
) = range(15)  # fmt: skip
MOST_OTHERS = 6  # others considered
UPRIGHT, LEVEL, ISOLATED_FIELDS = 15, 15 + MOST_OTHERS, 15 + 2 * MOST_OTHERS

# Fates: GONE is too old, or of what is no object; the others belong to the surface.
STAYS, GONE, GROUND, LEVEL_GROUND, SOLID_OBJECT = range(5)

# Bands of height over ground, which have clutter of their own kind: multipath below it, dust close above it,
# and what floats higher.
BELOW, LOW, HIGH = range(3)
NO_BAND = -1
HIGH_M = 2.5
