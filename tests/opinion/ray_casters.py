"""Two independent ray casters over the geometry of a simulated world: Embree and MuJoCo.

Neither is a dependency of the project: `pip install embreex mujoco`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.world.primitives import Box, Cylinder, Ellipsoid, Solid, Wire

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
MISS = -1


class Embree:
    """Embree over triangles. It finds the triangle in single precision; the range is computed in double.

    Parameters
    ----------
    triangles
        (n, 3, 3) corners.
    owner
        (n,) number of the surface that a triangle is of.
    """

    def __init__(self, triangles: F64, owner: I64) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._triangles, self._owner = triangles, owner
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, np.ascontiguousarray(triangles, np.float32))

    def cast(self, origins: F64, directions: F64) -> tuple[F64, I64, F64]:
        """Return range (NaN for none), surface (`MISS` for none) and the unit normals of rays."""
        found = self._scene.run(
            np.ascontiguousarray(origins, np.float32), np.ascontiguousarray(directions, np.float32)
        )
        number = np.asarray(found, np.int64)
        hit = number >= 0
        corners = self._triangles[number[hit]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        ahead = np.einsum("ij,ij->i", corners[:, 0] - origins[hit], normal)
        range_m, owner, normals = (
            np.full(len(origins), np.nan),
            np.full(len(origins), MISS),
            np.zeros((len(origins), 3)),
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            range_m[hit] = ahead / np.einsum("ij,ij->i", directions[hit], normal)
        owner[hit], normals[hit] = self._owner[number[hit]], normal
        return range_m, owner, normals


class MuJoCo:
    """MuJoCo over its own analytic boxes, cylinders and ellipsoids, all in double precision.

    Parameters
    ----------
    solids
        Solids of the world, each a geom; a wire is a cylinder, which has ends that a wire has not.
    """

    def __init__(self, solids: Sequence[Solid]) -> None:
        import mujoco

        self._mujoco = mujoco
        spec = mujoco.MjSpec()
        for solid in solids:
            _add(spec, mujoco.mjtGeom, solid)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)

    def cast(self, origins: F64, directions: F64) -> tuple[F64, I64, F64]:
        """Return range (NaN for none), solid (`MISS` for none) and the normals of rays."""
        range_m, owner = np.full(len(origins), np.nan), np.full(len(origins), MISS)
        normals = np.zeros((len(origins), 3))
        if not self._model.ngeom:
            return range_m, owner, normals
        places, group = np.unique(origins, axis=0, return_inverse=True)
        for k, place in enumerate(places):
            own = np.flatnonzero(group.ravel() == k)
            geom, t = np.empty(len(own), np.int32), np.empty(len(own))
            normal = np.empty(3 * len(own))
            rays = np.ascontiguousarray(directions[own]).ravel()
            self._mujoco.mj_multiRay(
                self._model, self._data, place, rays, None, True, -1, geom, t, normal, len(own), 1e6
            )
            range_m[own], owner[own] = np.where(geom < 0, np.nan, t), geom
            normals[own] = normal.reshape(-1, 3)
        return range_m, owner, normals


def _add(spec: Any, kinds: Any, solid: Solid) -> None:
    body = spec.worldbody
    if isinstance(solid, Box):
        half = (solid.length_m / 2, solid.width_m / 2, solid.height_m / 2)
        turn = (np.cos(solid.yaw_rad / 2), 0.0, 0.0, np.sin(solid.yaw_rad / 2))
        body.add_geom(
            type=kinds.mjGEOM_BOX, size=half, pos=(solid.x_m, solid.y_m, solid.z_m + half[2]), quat=turn
        )
    elif isinstance(solid, Cylinder):
        half_m = solid.height_m / 2
        body.add_geom(
            type=kinds.mjGEOM_CYLINDER,
            size=(solid.radius_m, half_m, 0.0),
            pos=(solid.x_m, solid.y_m, solid.z_m + half_m),
        )
    elif isinstance(solid, Ellipsoid):
        radii = (solid.radius_x_m, solid.radius_y_m, solid.radius_z_m)
        body.add_geom(type=kinds.mjGEOM_ELLIPSOID, size=radii, pos=(solid.x_m, solid.y_m, solid.z_m))
    else:
        assert isinstance(solid, Wire)
        body.add_geom(
            type=kinds.mjGEOM_CYLINDER,
            size=(solid.radius_m, 0.0, 0.0),
            fromto=(*solid.start_enu_m, *solid.end_enu_m),
        )
