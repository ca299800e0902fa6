"""Force and torque of the environment on an end effector, in the world frame; the torque about its tip."""

from collections.abc import Iterator

import mujoco
import numpy as np

from weberlink.geometry.vector import Vector
from weberlink_mujoco.robot.options import CONTACTS
from weberlink_mujoco.robot.plant import Plant

PressedContact = tuple[int, Vector, Vector, list[float]]
"""Number of the contact, its force [N] in the world frame, its own torque [N m] in its frame, and that frame, whose
rows are its axes in the world."""


def force_sensing(plant: Plant, name: str) -> "ContactSensing | ForceSensor":
    """What gives the force that the option `force` names; raises ValueError if the file has no such sensor."""
    return ContactSensing(plant) if name == CONTACTS else ForceSensor(plant, plant.sensor("force", "force", name))


def torque_sensing(plant: Plant, name: str) -> "ContactSensing | TorqueSensor":
    """What gives the torque that the option `rotation.torque` names; ValueError if the file has no such sensor, or no
    force sensor on the same site.
    """
    if name == CONTACTS:
        return ContactSensing(plant)
    return TorqueSensor(plant, plant.sensor("rotation.torque", "torque", name))


class ContactSensing:
    """All contacts between the body of the end effector, with all that hangs on it, and anything else: their sum, and
    that of r x f of each about the tip with its own torque.
    """

    def __init__(self, plant: Plant) -> None:
        model = plant.model
        bodies = {plant.body}
        for body in range(plant.body + 1, model.nbody):  # children come after their parents
            if model.body_parentid[body] in bodies:
                bodies.add(body)
        self._geoms = frozenset(geom for geom in range(model.ngeom) if model.geom_bodyid[geom] in bodies)
        self._model, self._data, self._contacts = model, plant.data, plant.data.contact
        self._wrench, self._tip = np.zeros(6), plant.position

    def contacts(self) -> Iterator[PressedContact]:
        """The contacts of the end effector, as it feels them."""
        if not self._data.ncon:
            return
        mine, wrench = self._geoms, self._wrench
        frames = self._contacts.frame.tolist()
        for number, (first, second) in enumerate(self._contacts.geom.tolist()):
            if (first in mine) is (second in mine):
                continue
            mujoco.mj_contactForce(self._model, self._data, number, wrench)
            a, b, c, d, e, f = wrench.tolist()
            if first in mine:  # the normal, and the force, point from first to second
                a, b, c, d, e, f = -a, -b, -c, -d, -e, -f
            frame = nx, ny, nz, sx, sy, sz, tx, ty, tz = frames[number]
            force = (a * nx + b * sx + c * tx, a * ny + b * sy + c * ty, a * nz + b * sz + c * tz)
            yield number, force, (d, e, f), frame

    def force(self) -> Vector:
        x = y = z = 0.0
        for _, (a, b, c), _, _ in self.contacts():
            x, y, z = x + a, y + b, z + c
        return (x, y, z)

    def torque(self) -> Vector:
        tx = ty = tz = 0.0
        ox, oy, oz = self._tip.tolist()
        places = self._contacts.pos.tolist()
        for number, (x, y, z), (d, e, f), (nx, ny, nz, sx, sy, sz, ux, uy, uz) in self.contacts():
            px, py, pz = places[number]
            px, py, pz = px - ox, py - oy, pz - oz
            tx += py * z - pz * y + d * nx + e * sx + f * ux
            ty += pz * x - px * z + d * ny + e * sy + f * uy
            tz += px * y - py * x + d * nz + e * sz + f * uz
        return (tx, ty, tz)


class ForceSensor:
    """A `<force>` sensor of the file, less the weight of what hangs on it, as a wrist sensor is tared.

    The sensor gives the force that holds the body of its site, and all that hangs on it, in the frame of the site:
    against what touches it, against its weight, and for its acceleration. Inertia is not subtracted.
    """

    def __init__(self, plant: Plant, sensor: int) -> None:
        model, data = plant.model, plant.data
        address, site = int(model.sensor_adr[sensor]), int(model.sensor_objid[sensor])
        self._local = data.sensordata[address : address + 3]
        self._frame = data.site_xmat[site]
        mass = float(model.body_subtreemass[model.site_bodyid[site]])
        gx, gy, gz = model.opt.gravity.tolist()
        self.weight: Vector = (mass * gx, mass * gy, mass * gz)

    def force(self) -> Vector:
        a, b, c = self._local.tolist()
        xx, xy, xz, yx, yy, yz, zx, zy, zz = self._frame.tolist()
        wx, wy, wz = self.weight
        return (-xx * a - xy * b - xz * c - wx, -yx * a - yy * b - yz * c - wy, -zx * a - zy * b - zz * c - wz)


class TorqueSensor:
    """A `<torque>` sensor of the file, referred to the tip, less the torque of the weight of what hangs on it.

    The sensor gives the torque that holds the body of its site, about that site. The force sensor on the same site
    gives what the change of the reference point adds. Inertia is not subtracted, as for the force.
    """

    def __init__(self, plant: Plant, sensor: int) -> None:
        model, data = plant.model, plant.data
        address, site = int(model.sensor_adr[sensor]), int(model.sensor_objid[sensor])
        self._force = ForceSensor(plant, plant.force_sensor_on(site))
        self._local = data.sensordata[address : address + 3]
        self._frame, self._place, self._tip = data.site_xmat[site], data.site_xpos[site], plant.position
        self._centre = data.subtree_com[int(model.site_bodyid[site])]

    def torque(self) -> Vector:
        a, b, c = self._local.tolist()
        xx, xy, xz, yx, yy, yz, zx, zy, zz = self._frame.tolist()
        place, tip, centre = self._place.tolist(), self._tip.tolist(), self._centre.tolist()
        wx, wy, wz = moment(centre, place, self._force.weight)
        fx, fy, fz = moment(place, tip, self._force.force())
        return (
            fx - wx - xx * a - xy * b - xz * c,
            fy - wy - yx * a - yy * b - yz * c,
            fz - wz - zx * a - zy * b - zz * c,
        )


def moment(at: list[float], about: list[float], force: Vector) -> Vector:
    """The torque of a force at one point about another."""
    x, y, z = at[0] - about[0], at[1] - about[1], at[2] - about[2]
    return (y * force[2] - z * force[1], z * force[0] - x * force[2], x * force[1] - y * force[0])
