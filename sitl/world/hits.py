"""Codes of what a pulse returns from.

A code of 0 or more and below `MOVERS` is the number of a solid, one from `MOVERS` on that of a mover's part.
"""

from __future__ import annotations

GROUND = -1
NOTHING = -2
WATER = -3
PLANTS = -4
"""Crops, meadow or snow over the ground."""
DUST = -5
"""Nothing solid: dust or rain."""
GHOST = -6
"""Nothing at all: an echo by way of several surfaces, or of the receiver itself."""
MOVERS = 1_000_000
