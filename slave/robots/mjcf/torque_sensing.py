"""The torque of the environment on an end effector about its tip, in the world frame. The mirror of `sensing`."""

from typing import Protocol

import mujoco
import numpy as np

from weberlink.geometry.vector import Vector
from weberlink.slave.robots.mjcf.options import CONTACTS
from weberlink.slave.robots.mjcf.plant import Plant
from weberlink.slave.robots.mjcf.sensing import SensorSensing, geoms_of


class TorqueSensing(Protocol):
    """Reads the torque [N m] of the step that the plant just did."""

    def torque(self) -> Vector: ...


def torque_sensing(plant: Plant, name: str) -> TorqueSensing:
    """The one that the option `rotation.torque` names.

    Raises:
        ValueError: if the file has no such sensor, or no force sensor beside it.
    """
    return ContactTorque(plant) if name == CONTACTS else SensorTorque(plant, plant.torque_sensor(name))


class ContactTorque:
    """The sum over all contacts of the end effector: r x f of each about the tip, and the torque that it has itself."""

    def __init__(self, plant: Plant) -> None:
        self._geoms = geoms_of(plant)
        self._model, self._data, self._contacts = plant.model, plant.data, plant.data.contact
        self._tip = plant.position
        self._wrench = np.zeros(6)

    def torque(self) -> Vector:
        if not self._data.ncon:
            return (0.0, 0.0, 0.0)
        mine, wrench = self._geoms, self._wrench
        tx = ty = tz = 0.0
        ox, oy, oz = self._tip.tolist()
        frames, places = self._contacts.frame.tolist(), self._contacts.pos.tolist()
        for number, (first, second) in enumerate(self._contacts.geom.tolist()):
            if (first in mine) is (second in mine):
                continue
            mujoco.mj_contactForce(self._model, self._data, number, wrench)
            a, b, c, d, e, f = wrench.tolist()
            if first in mine:
                a, b, c, d, e, f = -a, -b, -c, -d, -e, -f
            nx, ny, nz, sx, sy, sz, ux, uy, uz = frames[number]
            x, y, z = a * nx + b * sx + c * ux, a * ny + b * sy + c * uy, a * nz + b * sz + c * uz
            px, py, pz = places[number]
            px, py, pz = px - ox, py - oy, pz - oz
            tx += py * z - pz * y + d * nx + e * sx + f * ux
            ty += pz * x - px * z + d * ny + e * sy + f * uy
            tz += px * y - py * x + d * nz + e * sz + f * uz
        return (tx, ty, tz)


class SensorTorque:
    """A `<torque>` sensor of the file, taken about the tip, less the torque of the weight of what hangs on it.

    It gives what holds the body of its site to the parent, about that site. The force sensor on the same site says what
    moving the point to the tip adds. Inertia stays, as it does in the force.
    """

    def __init__(self, plant: Plant, sensor: int) -> None:
        model, data = plant.model, plant.data
        address, site = int(model.sensor_adr[sensor]), int(model.sensor_objid[sensor])
        self._force = SensorSensing(plant, plant.force_sensor_on(site))
        self._local = data.sensordata[address : address + 3]
        self._frame, self._place, self._tip = data.site_xmat[site], data.site_xpos[site], plant.position
        body = int(model.site_bodyid[site])
        self._centre = data.subtree_com[body]
        mass = float(model.body_subtreemass[body])
        gx, gy, gz = model.opt.gravity.tolist()
        self._weight: Vector = (mass * gx, mass * gy, mass * gz)

    def torque(self) -> Vector:
        a, b, c = self._local.tolist()
        xx, xy, xz, yx, yy, yz, zx, zy, zz = self._frame.tolist()
        place, tip, centre = self._place.tolist(), self._tip.tolist(), self._centre.tolist()
        wx, wy, wz = cross(centre, place, self._weight)
        fx, fy, fz = cross(place, tip, self._force.force())
        return (
            fx - wx - xx * a - xy * b - xz * c,
            fy - wy - yx * a - yy * b - yz * c,
            fz - wz - zx * a - zy * b - zz * c,
        )


def cross(to: list[float], about: list[float], force: Vector) -> Vector:
    """The torque of a force at one point about another."""
    x, y, z = to[0] - about[0], to[1] - about[1], to[2] - about[2]
    return (y * force[2] - z * force[1], z * force[0] - x * force[2], x * force[1] - y * force[0])
