"""The force of the environment on an end effector, in the world frame. Knows no control and no units but newtons."""

from typing import Protocol

import mujoco
import numpy as np

from weberlink.geometry.vector import Vector
from weberlink.slave.robots.mjcf.options import CONTACTS
from weberlink.slave.robots.mjcf.plant import Plant


class Sensing(Protocol):
    """Reads the force [N] of the step that the plant just did."""

    def force(self) -> Vector: ...


def sensing(plant: Plant, name: str) -> Sensing:
    """The one that the option `force` names.

    Raises:
        ValueError: if the file has no such sensor.
    """
    return ContactSensing(plant) if name == CONTACTS else SensorSensing(plant, plant.sensor(name))


class ContactSensing:
    """The sum of all contacts between the body of the end effector, with all that hangs on it, and anything else."""

    def __init__(self, plant: Plant) -> None:
        self._geoms = geoms_of(plant)
        self._model, self._data, self._contacts = plant.model, plant.data, plant.data.contact
        self._wrench = np.zeros(6)

    def force(self) -> Vector:
        if not self._data.ncon:
            return (0.0, 0.0, 0.0)
        mine, wrench = self._geoms, self._wrench
        x = y = z = 0.0
        frames = self._contacts.frame.tolist()
        for number, (first, second) in enumerate(self._contacts.geom.tolist()):
            if (first in mine) is (second in mine):
                continue
            mujoco.mj_contactForce(self._model, self._data, number, wrench)
            a, b, c, _, _, _ = wrench.tolist()
            if first in mine:
                a, b, c = -a, -b, -c
            # The rows of the frame are its axes in the world; the normal, and the force, point from first to second.
            nx, ny, nz, sx, sy, sz, tx, ty, tz = frames[number]
            x += a * nx + b * sx + c * tx
            y += a * ny + b * sy + c * ty
            z += a * nz + b * sz + c * tz
        return (x, y, z)


class SensorSensing:
    """A `<force>` sensor of the file, less the weight of what hangs on it.

    It gives the force that holds the body of its site, and all that hangs on it, to the parent of that body, in the
    frame of the site: against what touches it, against its weight, and for its acceleration. The weight is known and is
    taken off, as a wrist sensor is tared; inertia stays.
    """

    def __init__(self, plant: Plant, sensor: int) -> None:
        model, data = plant.model, plant.data
        address, site = int(model.sensor_adr[sensor]), int(model.sensor_objid[sensor])
        self._local = data.sensordata[address : address + 3]
        self._frame = data.site_xmat[site]
        mass = float(model.body_subtreemass[model.site_bodyid[site]])
        gx, gy, gz = model.opt.gravity.tolist()
        self._weight: Vector = (mass * gx, mass * gy, mass * gz)

    def force(self) -> Vector:
        a, b, c = self._local.tolist()
        xx, xy, xz, yx, yy, yz, zx, zy, zz = self._frame.tolist()
        wx, wy, wz = self._weight
        return (-xx * a - xy * b - xz * c - wx, -yx * a - yy * b - yz * c - wy, -zx * a - zy * b - zz * c - wz)


def geoms_of(plant: Plant) -> frozenset[int]:
    """Those of the body of the end effector, and of all that hangs on it."""
    model = plant.model
    bodies = {plant.body}
    for body in range(plant.body + 1, model.nbody):  # children come after their parents
        if model.body_parentid[body] in bodies:
            bodies.add(body)
    return frozenset(geom for geom in range(model.ngeom) if model.geom_bodyid[geom] in bodies)
