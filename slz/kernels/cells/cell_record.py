"""What is held of a cell: the fields of its evidence, and the layers of what they say."""

import numpy as np

# Fields of one of a cell's two epochs, see `slz.terrain.terrain`; both fill the lanes.
COUNT, MEAN, NOISE, LOW, LOW2, HIGH, HIGH2, TIME = range(8)
FIELDS = 8
TILE_BITS = 6
TILE = 1 << TILE_BITS  # cells along the side of a tile

# Layers of `slz.kernels.cells.cell_statistics.summarise`.
HEIGHT, BOTTOM, TOP, WEIGHT, EXCESS, SPREAD = range(6)
LAYERS = 6

# What is known of a cell, see `slz.terrain.terrain_maps`.
IS_UNSAFE, IS_SAFE, IS_UNKNOWN = np.uint8(0), np.uint8(1), np.uint8(255)
