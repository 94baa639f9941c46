"""Record layout of a surface cell: what its returns say of the surface, besides the ground's shape."""

# COUNT, MEAN, SQUARES, LOW, HIGH: number, mean height (m), sum of squared deviations (m2), lowest and highest
# of the returns near enough for heights. DEEP, TALL: returns lower, and higher, than the mean of the ones
# before by `APART_M`. SEVERAL: returns of rays with several. NUMBERED: returns with a return number.
# SLANTED, OBLIQUE: returns at incidence from `SLANTED_DEG` on, and from `OBLIQUE_DEG` on. LOST_SLANTED,
# LOST_OBLIQUE: rays without a return, likewise; LOST_NEAR: those of both within `SURE_M`; REPORTED: those
# that their driver reported, which each stand for several. DARK: returns from `DIFFUSE_DEG` on that are
# darker than any dry ground, less the brighter ones from `NO_MIRROR_DEG` on. TIME: of the newest return (s).
# NADIR, NADIR_M, NADIR_LIGHT: number, mean height and mean intensity of the returns of known intensity below
# `NADIR_DEG`; ASIDE, ASIDE_M, ASIDE_LIGHT: of those from `ASIDE_DEG` to `OBLIQUE_DEG`.
(
    COUNT, SQUARES, DEEP, TALL, SEVERAL, NUMBERED, SLANTED, OBLIQUE, LOST_SLANTED, LOST_OBLIQUE, LOST_NEAR,
    REPORTED, DARK, NADIR, ASIDE, MEAN, LOW, HIGH, NADIR_M, NADIR_LIGHT, ASIDE_M, ASIDE_LIGHT, TIME,
) = range(23)  # fmt: skip
SUMS = 15  # the first ones, which are halved where a cell has too many returns
SURFACE_FIELDS = 23

SLANTED_DEG = 6.0
OBLIQUE_DEG = 30.0
FLATTEST_DEG = 65.0  # the loss of a ray that grazes the ground more is weak evidence
NADIR_DEG = 6.0  # incidence within which a mirror of gentle waves shows
ASIDE_DEG = 12.0  # from which on it does not
DIFFUSE_DEG, NO_MIRROR_DEG = (
    15.0,
    22.0,
)  # incidence from which on a mirror of a breeze, and of a storm, shows nothing
DARKEST = 0.035  # share of the light of a white target that wet tarmac and coal send back at least
APART_M = 0.25  # more than a slope of 14 degrees makes within a metre
FARTHEST_M = 70.0  # range beyond which a lost ray is no evidence
SURE_M = 35.0  # range within which few dry surfaces do not answer
ANSWER_M = 25.0  # range within which dark wet tarmac still answers an oblique ray

# Layers of `slz.kernels.surface.smooth_planes.smooth_planes`.
LEVEL, GRADIENT, RESIDUAL, N = range(4)
PLANE_LAYERS = 4

# Layers of a classified cell, which its record holds from LAYERS on. WATER to CANOPY: probabilities, 0 where
# nothing was seen; the rest is bare ground, where enough was seen. RAISED: height of a roof over the ground
# around (m). KIND: the likeliest `slz.surface.surface_kinds.SurfaceKind`. SHAPE: log odds for water that the
# level extent of the cell gives, 0 for none; SHAPE_S: when it was found with all its surroundings (s).
WATER, ROOF, LOW_VEGETATION, CANOPY, RAISED, KIND, SHAPE = range(7)
N_LAYERS = 7
LAYERS = SURFACE_FIELDS
SHAPE_S = LAYERS + N_LAYERS
RECORD = SHAPE_S + 1
