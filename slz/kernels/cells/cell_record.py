"""Record layout of a cell: fields of its evidence, and layers of its statistics."""

import numpy as np

# Fields of each of a cell's two epochs, see `slz.terrain.terrain`; both together fill the 16 lanes.
COUNT, MEAN, NOISE, LOW, LOW2, HIGH, HIGH2, TIME = range(8)
FIELDS = 8
RECORD = 2 * FIELDS  # numbers in a cell's evidence
TILE_BITS = 6
TILE = 1 << TILE_BITS  # cells along the side of a tile

# Layers of `slz.kernels.cells.cell_statistics.summarise`.
HEIGHT, BOTTOM, TOP, WEIGHT, EXCESS, SPREAD = range(6)
SUMMARY_LAYERS = 6

# States of a cell, see `slz.terrain.terrain_maps`.
IS_UNSAFE, IS_SAFE, IS_UNKNOWN = np.uint8(0), np.uint8(1), np.uint8(255)
