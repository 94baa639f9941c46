"""Parameters of the simulated autopilot: ArduCopter's names, units and defaults, set up for a companion."""

from __future__ import annotations

import math

from sitl.autopilot.aiding import ekf2_odometry, external_navigation, source_sets

DEFAULTS: dict[str, float] = {
    **source_sets.DEFAULTS,
    **external_navigation.DEFAULTS,
    "SYSID_MYGCS": 255,
    "SYSID_THISMAV": 1,
    "ARMING_CHECK": 1,
    "AVOID_ENABLE": 3,
    "AVOID_MARGIN": 2,
    "BATT_CAPACITY": 5200,
    "BATT_FS_LOW_ACT": 0,  # 0 warns, 1 lands, 2 returns, 3 and 4 return along the path, 7 brakes
    "BATT_LOW_MAH": 0,
    "BATT_LOW_TIMER": 10,  # s
    "BATT_LOW_VOLT": 10.5,
    "DISARM_DELAY": 10,
    "EK3_RNG_USE_HGT": -1,
    "EK3_DRAG_MCOEF": 0.23,  # 1/s, of its vehicle, 8 % too low; ArduCopter's default 0 estimates no wind
    "FENCE_ACTION": 1,  # 0 reports, 1 returns, 2 lands, 3 and 5 return along the path, 4 brakes
    "FENCE_ALT_MAX": 100,
    "FENCE_ALT_MIN": -10,
    "FENCE_AUTOENABLE": 0,
    "FENCE_ENABLE": 0,
    "FENCE_MARGIN": 2,
    "FENCE_MARGIN_XY": 0,
    "FENCE_OPTIONS": 0,  # 2 unites the areas of inclusion
    "FENCE_RADIUS": 300,
    "FENCE_TOTAL": 0,
    "FENCE_TYPE": 7,  # 1 ceiling, 2 circle, 4 areas, 8 floor
    "FRAME_CLASS": 1,
    "FRAME_TYPE": 1,
    "FS_GCS_ENABLE": 0,  # 1 returns, 3 and 4 return along the path, 5 lands, 7 brakes
    "FS_GCS_TIMEOUT": 5,
    "FS_OPTIONS": 16,  # 8 continues a landing, 16 a pilot's flight without a ground station
    "FS_THR_ENABLE": 1,  # 1 returns, 3 lands, 4 and 5 return along the path, 7 brakes
    "GPS2_TYPE": 0,  # 0 is no second receiver
    "GUID_OPTIONS": 0,
    "GUID_TIMEOUT": 3.0,
    "LAND_ALT_LOW": 1000,  # cm
    "LAND_REPOSITION": 1,
    "LAND_SPEED": 50,  # cm/s
    "LAND_SPEED_HIGH": 0,  # cm/s, 0 takes WPNAV_SPEED_DN
    "LOIT_SPEED": 1250,  # cm/s
    "MIS_TOTAL": 0,
    "PILOT_SPEED_UP": 250,
    "PLND_ENABLED": 1,
    "PLND_ACC_P_NSE": 2.5,
    "PLND_CAM_POS_X": 0,  # m forward
    "PLND_CAM_POS_Y": 0,
    "PLND_CAM_POS_Z": 0,
    "PLND_LAND_OFS_X": 0,  # cm forward of the target
    "PLND_LAND_OFS_Y": 0,
    "PLND_OPTIONS": 0,
    "PLND_YAW_ALIGN": 0,  # 0.01 deg
    "PLND_TYPE": 1,
    "PLND_EST_TYPE": 1,
    "PLND_LAG": 0.02,
    "PLND_TIMEOUT": 4,
    "PLND_STRICT": 1,
    "PLND_RET_BEHAVE": 0,  # 0 retries at the vehicle's last place, 1 over the target
    "PLND_RET_MAX": 4,
    "PLND_ALT_MIN": 0.75,
    "PLND_ALT_MAX": 8,
    "PLND_XY_DIST_MAX": 2.5,
    "PRX1_ORIENT": 0,  # 1 mirrors
    "PRX1_TYPE": 0,
    "PRX1_YAW_CORR": 0,  # deg
    "RALLY_INCL_HOME": 1,
    "RALLY_LIMIT_KM": 0.3,
    "RALLY_TOTAL": 0,
    "RNGFND1_TYPE": 10,
    "RNGFND1_MIN": 0.2,
    "RNGFND1_MAX": 70,
    "RNGFND1_ORIENT": 25,
    "RTL_ALT": 1500,  # cm
    "RTL_ALT_FINAL": 0,  # cm, 0 lands
    "RTL_CLIMB_MIN": 0,  # cm
    "RTL_CONE_SLOPE": 3,
    "RTL_LOIT_TIME": 5000,  # ms
    "RTL_SPEED": 0,
    "SERIAL1_BAUD": 921,
    "SERIAL1_PROTOCOL": 2,
    "WPNAV_ACCEL": 250,  # cm/s2
    "WPNAV_SPEED": 500,  # cm/s
    "WPNAV_SPEED_DN": 150,
    "WPNAV_SPEED_UP": 250,
    "WP_YAW_BEHAVIOR": 2,
}

_LIMITS: dict[str, tuple[float, float]] = {
    **external_navigation.LIMITS,
    "SYSID_MYGCS": (1, 255),
    "SYSID_THISMAV": (1, 255),
    "AVOID_ENABLE": (0, 7),
    "AVOID_MARGIN": (1, 10),
    "BATT_FS_LOW_ACT": (0, 7),
    "DISARM_DELAY": (0, 127),
    "EK3_DRAG_MCOEF": (0, 1),
    "FENCE_ACTION": (0, 5),
    "FENCE_ALT_MAX": (10, 1000),
    "FENCE_ALT_MIN": (-100, 100),
    "FENCE_RADIUS": (0, 10_000),
    "FENCE_TYPE": (0, 15),
    "FS_GCS_ENABLE": (0, 7),
    "FS_GCS_TIMEOUT": (2, 120),
    "FS_OPTIONS": (0, 63),
    "FS_THR_ENABLE": (0, 7),
    "GUID_TIMEOUT": (0.1, 60),
    "LAND_ALT_LOW": (100, 10_000),
    "LAND_REPOSITION": (0, 1),
    "LAND_SPEED": (30, 200),
    "LAND_SPEED_HIGH": (0, 500),
    "LOIT_SPEED": (20, 3500),
    "PILOT_SPEED_UP": (10, 500),
    "PLND_EST_TYPE": (0, 1),
    "EK3_RNG_USE_HGT": (-1, 70),
    "PLND_CAM_POS_X": (-5, 5),
    "PLND_CAM_POS_Y": (-5, 5),
    "PLND_CAM_POS_Z": (-5, 5),
    "PLND_LAND_OFS_X": (-1000, 1000),
    "PLND_LAND_OFS_Y": (-1000, 1000),
    "PLND_YAW_ALIGN": (0, 36_000),
    "PLND_LAG": (0.02, 0.25),
    "PLND_TIMEOUT": (0, 20),
    "PLND_STRICT": (0, 2),
    "PLND_RET_BEHAVE": (0, 1),
    "PLND_RET_MAX": (0, 10),
    "PLND_ALT_MIN": (0, 5),
    "PLND_ALT_MAX": (0, 50),
    "PLND_XY_DIST_MAX": (0, 10),
    "PRX1_YAW_CORR": (-180, 180),
    "RALLY_INCL_HOME": (0, 1),
    "RNGFND1_MIN": (0, 100),
    "RNGFND1_MAX": (0, 1000),
    "RTL_ALT": (30, 300_000),
    "RTL_ALT_FINAL": (0, 1000),
    "RTL_CLIMB_MIN": (0, 3000),
    "RTL_CONE_SLOPE": (0, 10),
    "RTL_LOIT_TIME": (0, 60_000),
    "RTL_SPEED": (0, 2000),
    "WPNAV_ACCEL": (50, 500),
    "WPNAV_SPEED": (10, 2000),
    "WPNAV_SPEED_DN": (10, 500),
    "WPNAV_SPEED_UP": (10, 1000),
}
_ANY = (0.0, 65_535.0)


def with_defaults(parameters: dict[str, float]) -> dict[str, float]:
    """Return parameters with `DEFAULTS`, and those of PX4's EKF2 if EKF2_EN is set."""
    ekf2 = ekf2_odometry.DEFAULTS if parameters.get("EKF2_EN") else {}
    return DEFAULTS | ekf2 | parameters


def in_range(name: str, value: float) -> bool:
    """Return whether a parameter may be set to a value; never to a non-finite one."""
    low, high = _LIMITS.get(name, _ANY)
    return math.isfinite(value) and low <= value <= high
