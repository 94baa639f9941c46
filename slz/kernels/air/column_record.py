"""Record layout of a column in which something stands that was not there before."""

import numpy as np

# ROW, COL: of the column, from the evidence's corner. CAME: when the first return came (s). GONE: proven
# empty; such a one counts as long as others around are not. TOP_EAST, TOP_NORTH, TOP and BASE_EAST,
# BASE_NORTH, BASE: highest and lowest return. RETURNED, BEFORE, SINCE: number of rays it returned, of those
# that passed between the first and the last one that it or a column around returned, and of those since.
# SCANS_RETURNED, SCANS_BEFORE, SCANS_SINCE: the same of scans, of it and of the columns around. EAST, NORTH,
# UP, RANGE: unit vector and length of the rays returned.
(
    ROW, COL, CAME, GONE, TOP_EAST, TOP_NORTH, TOP, BASE_EAST, BASE_NORTH, BASE,
    RETURNED, BEFORE, SINCE, SCANS_RETURNED, SCANS_BEFORE, SCANS_SINCE, EAST, NORTH, UP, RANGE,
) = range(20)  # fmt: skip
COLUMN_FIELDS = 20

SAME_SIDE = np.cos(np.radians(20.0))  # between a ray and those that were returned, of rays that are alike
FARTHER = 1.25  # of the range of those that were returned, beyond which a ray may miss what is thin
