"""Record layout of a surface cell: what its returns say of the surface, besides the ground's shape."""

# COUNT, MEAN, SQUARES: number, mean height (m) and sum of squared deviations (m2) of the returns near enough
# for heights. DEEP, TALL: returns lower, and higher, than the mean of the ones before by `APART_M`. SEVERAL:
# returns of rays with several. TOLD: returns whose ray told the number of its returns. STEEP, OBLIQUE:
# returns at incidence up to `STEEP_DEG`, and from `OBLIQUE_DEG` on. LOST: oblique rays without a return.
# BRIGHT, DIM: sums of the intensity of steep returns, and of those between steep and oblique; N_BRIGHT, N_DIM
# their numbers. TIME: of the newest return (s).
(
    COUNT, MEAN, SQUARES, LOW, HIGH, DEEP, TALL, SEVERAL, TOLD, STEEP, OBLIQUE, LOST, BRIGHT, DIM, N_DIM,
    TIME,
) = range(16)  # fmt: skip
SURFACE_FIELDS = 16

STEEP_DEG = 12.0
OBLIQUE_DEG = 30.0
FLATTEST_DEG = 65.0  # a ray that grazes the ground more tells little by its loss
APART_M = 0.25  # more than a slope of 14 degrees makes within a metre
ANSWER_M = 25.0  # range within which dark wet tarmac still answers an oblique ray

# Layers of `slz.kernels.surface.smooth_planes.smooth_planes`.
N, LEVEL, GRADIENT, RESIDUAL = range(4)
PLANE_LAYERS = 4
