"""Filter of returns that are not ground: the vehicle itself, rain and dust near the sensor.

A dropped return does not mark its ray as free: ground that was not seen stays unknown. Nor does its ray count
as lost, since it did return.
"""

from __future__ import annotations

import numpy as np

from companion.flight.geometry.sensor_mount import Mount
from companion.flight.sensors.returns import Returns
from params import Parameters


class VehicleAndDustFilter:
    """Drops returns and counts them by reason.

    - vehicle: nearer to the autopilot than `vehicle_m`;
    - rain and dust: nearer to the sensor than `dust_reach_m`, and weaker than `dust_intensity` or not the
      last return of their ray, because a target that lets light pass is not ground.

    Isolated returns are dropped by the pipeline, see `outliers`; the range gate is in the georeferencer.

    Attributes
    ----------
    vehicle, dust
        Returns dropped so far.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._p = parameters
        self._mount = Mount(parameters)
        self.vehicle = 0
        self.dust = 0

    def filter(self, returns: Returns) -> Returns:
        """Return the returns that pass, in their order."""
        p = self._p
        drop = np.zeros(len(returns), bool)
        if p.vehicle_m > 0:
            body = returns.xyz_sensor_m @ self._mount.rotation_frd_from_sensor.T + self._mount.lever_frd_m
            drop = np.einsum("ij,ij->i", body, body) < p.vehicle_m**2
            self.vehicle += int(drop.sum())
        if p.dust_reach_m > 0:
            xyz = returns.xyz_sensor_m
            near = np.einsum("ij,ij->i", xyz, xyz) < p.dust_reach_m**2
            weak = ~(returns.intensity >= p.dust_intensity) & (p.dust_intensity > 0)  # also if unknown
            dust = near & (weak | (returns.echo < returns.echoes)) & ~drop
            self.dust += int(dust.sum())
            drop = drop | dust
        return returns.select(~drop) if drop.any() else returns
