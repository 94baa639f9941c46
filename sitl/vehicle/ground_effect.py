"""Ground effect: more thrust from the same power close to the ground."""

from __future__ import annotations

from sitl.compilation import kernel_for_any_types

ROTOR_RADIUS_M = 0.2
ROTOR_OVER_FEET_M = 0.3
LEAST_RATIO = 0.5  # rotor height by radius, below which the formula is not valid


@kernel_for_any_types
def ground_effect(height_m: float) -> float:
    """Return thrust by thrust far from the ground, at a height of the feet (m).

    Cheeseman and Bennett 1955 (ARC R&M 3021), in hover: T / T_inf = 1 / (1 - (R / 4z)^2), for
    one rotor of radius R at height z. Several rotors gain more (Sanchez-Cuevas et al. 2017).
    """
    rotor_m = max(height_m + ROTOR_OVER_FEET_M, LEAST_RATIO * ROTOR_RADIUS_M)
    share = ROTOR_RADIUS_M / (4.0 * rotor_m)
    return 1.0 / (1.0 - share * share)
