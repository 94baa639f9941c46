"""Table of all parameters.

A parameter is a field of `Parameters`: its Python name contains the unit; the `Spec` beside its type holds
the MAVLink name, unit, source and one sentence. Validation, profiles, command line, parameter server and
documentation all read this table. A value outside its range is refused, never clamped.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from pydantic import field_validator, model_validator

from params.landing_parameters import LandingParameters
from params.spec import Spec

GEAR_SHARES = {"pads": (0.285, 0.285), "skids": (0.6, 0.44), "tripod": (0.6, 0.44)}  # of the footprint
LEAST_GEAR_M = 0.1
CELLS_AT_MOST = (
    ("surround_m", 1000),
    ("footprint_m", 100),
    ("coverage_m", 100),
    ("rotor_diameter_m", 400),
    ("tail_length_m", 200),
    ("d_value_m", 400),
)
TILT_OVER_SLOPE_DEG = 5.0  # by which a landed vehicle may tilt more than the ground slopes


class Parameters(LandingParameters):
    """Immutable, validated set of all parameters (`params.load` builds one from a profile)."""

    @property
    def gear_size_m(self) -> tuple[float, float]:
        """Length and width of the gear between its outermost contacts."""
        length, width = GEAR_SHARES.get(self.gear, (0.0, 0.0))
        return self.gear_length_m or length * self.footprint_m, self.gear_width_m or width * self.footprint_m

    @property
    def greatest_tilt_deg(self) -> float:
        """Tilt of the landed vehicle below which it stands safely."""
        return self.tip_limit_deg or self.safe_slope_deg + TILT_OVER_SLOPE_DEG

    @property
    def greatest_dimension_m(self) -> float:
        """D: greatest dimension with rotors turning; 0 for a vehicle without disc, tail and D."""
        radius_m = self.rotor_diameter_m / 2
        return self.d_value_m or radius_m + max(radius_m, self.tail_length_m)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_value(cls, value: Any) -> Any:
        if isinstance(value, bool):  # would count as 0 or 1
            raise ValueError("true and false are no values of a parameter")
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for low, high in (
            ("lidar_min_m", "lidar_max_m"),
            ("commit_height_m", "final_height_m"),
            ("dust_height_m", "final_height_m"),
            ("cell_m", "min_square_m"),
            ("cell_m", "zone_m"),
            ("safe_slope_deg", "worst_slope_deg"),
            ("min_square_m", "zone_m"),
            ("hold_s", "max_age_s"),
        ):
            if getattr(self, low) > getattr(self, high):
                raise ValueError(
                    f"{low} ({getattr(self, low)}) must not exceed {high} ({getattr(self, high)})"
                )
        for size, most in CELLS_AT_MOST:
            if getattr(self, size) > most * self.cell_m:
                raise ValueError(
                    f"{size} ({getattr(self, size)}) must not exceed {most} cells of cell_m ({self.cell_m})"
                )
        if self.mode == "default" and self.gear != "none":
            self._check_gear()
        if self.mode == "default":
            self._check_discs()
        if self.mode == "default" and self.angle_noise_deg > 0 and self.range_noise_m >= self.height_noise_m:
            raise ValueError(
                f"range_noise_m ({self.range_noise_m}) must be less than height_noise_m"
                f" ({self.height_noise_m}), or no return is certain enough to be mapped"
            )
        return self

    def _check_gear(self) -> None:
        for name in ("gear_length_m", "gear_width_m"):
            if 0 < getattr(self, name) < LEAST_GEAR_M:
                raise ValueError(f"{name} ({getattr(self, name)}) must be 0 or at least {LEAST_GEAR_M} m")
        if self.safe_slope_deg > self.greatest_tilt_deg:
            raise ValueError(
                f"safe_slope_deg ({self.safe_slope_deg}) must not exceed tip_limit_deg"
                f" ({self.tip_limit_deg}), unless that is 0 or gear is none"
            )
        length_m, width_m = self.gear_size_m
        across_m = math.hypot(length_m, width_m) + 2 * self.pad_radius_m
        if across_m > self.footprint_m:
            raise ValueError(
                f"footprint_m ({self.footprint_m}) must hold the gear: {across_m:.2f} m across with"
                f" gear_length_m {length_m:g}, gear_width_m {width_m:g} and pad_radius_m {self.pad_radius_m}"
            )

    def _check_discs(self) -> None:
        for name in ("rotor_diameter_m", "tail_length_m", "d_value_m"):
            if 0 < getattr(self, name) < LEAST_GEAR_M:
                raise ValueError(f"{name} ({getattr(self, name)}) must be 0 or at least {LEAST_GEAR_M} m")
        length_m, width_m = self.gear_size_m
        if 0 < self.rotor_diameter_m < max(length_m, width_m):
            raise ValueError(
                f"rotor_diameter_m ({self.rotor_diameter_m}) must be 0 or no less than the gear, which is"
                f" {length_m:g} m long and {width_m:g} m wide"
            )
        if 0 < self.tail_length_m <= length_m / 2:
            raise ValueError(
                f"tail_length_m ({self.tail_length_m}) must be 0 or beyond the gear, which ends"
                f" {length_m / 2:g} m behind the centre of gravity"
            )
        for size, height in (("rotor_diameter_m", "rotor_height_m"), ("tail_length_m", "tail_height_m")):
            if getattr(self, size) > 0 and getattr(self, height) <= self.rotor_clearance_m:
                raise ValueError(
                    f"{height} ({getattr(self, height)}) must exceed rotor_clearance_m"
                    f" ({self.rotor_clearance_m}), unless {size} is 0"
                )
        radius_m = self.rotor_diameter_m / 2
        least_m = max(radius_m + max(radius_m, self.tail_length_m), length_m, width_m)
        if 0 < self.d_value_m < least_m - 1e-9:
            raise ValueError(
                f"d_value_m ({self.d_value_m}) must be 0 or at least {least_m:g} m, the size of gear,"
                f" rotor_diameter_m ({self.rotor_diameter_m}) and tail_length_m ({self.tail_length_m})"
            )


@dataclass(frozen=True, slots=True)
class Row:
    """Row of the parameter table for the command line, the parameter server and the documentation."""

    name: str
    mavlink: str
    unit: str
    kind: type
    low: float | None
    high: float | None
    choices: tuple[str, ...]
    default: Any
    source: str
    sentence: str
    live: bool
    grounded: Mapping[str, str] = field(default_factory=dict)

    @property
    def airworthy_choices(self) -> tuple[str, ...]:
        """Choices that may fly."""
        return tuple(choice for choice in self.choices if choice not in self.grounded)


def rows() -> tuple[Row, ...]:
    """Return the whole table in its order."""
    return tuple(_row(name) for name in Parameters.model_fields)


def _row(name: str) -> Row:
    field = Parameters.model_fields[name]
    spec = next(m for m in field.metadata if isinstance(m, Spec))
    bounds = {key: getattr(m, key) for m in field.metadata for key in ("ge", "le") if hasattr(m, key)}
    choices = getattr(field.annotation, "__args__", ())
    return Row(
        name=name,
        mavlink=spec.mavlink,
        unit=spec.unit,
        kind=str if choices else int if field.annotation is int else float,
        low=bounds.get("ge"),
        high=bounds.get("le"),
        choices=tuple(choices),
        default=field.default,
        source=spec.source,
        sentence=spec.sentence,
        live=spec.live,
        grounded=spec.grounded,
    )
