"""Control of position and orientation of an end effector, and the torque of its surroundings about the tip."""

from math import pi
from typing import Protocol

import mujoco
import numpy as np

from weberlink.geometry.rotation import Quaternion, inverse, product, unit_quaternion, vector
from weberlink.geometry.vector import Vector
from weberlink_mujoco.impedance import IMMOBILE, JointTorques
from weberlink_mujoco.options import CONTACTS
from weberlink_mujoco.plant import Array, Plant
from weberlink_mujoco.sensing import ContactSensing, SensorSensing

STILL_ALIKE = 0.9986
"""Cosine of half the angle (6 degrees) by which it may turn before its damping is computed anew."""


class PoseImpedance:
    """wrench = K e - D J v with the 6 rows of J.

    e is the difference to the commanded position and the rotation vector to the commanded orientation, K the stiffness
    of each: the torque is that of the spring k |e|^2 / 2 (Hogan 1985). D gives every mode of the end effector the same
    damping ratio r: with W the modes of K^(1/2) (J M^-1 J^T) K^(1/2) and w their frequencies, D = K^(1/2) W (2 r / w)
    W^T K^(1/2), which equals that of `Impedance` where all stiffnesses are alike. A blocked mode has no damper. The
    inertia of a long, thin tool about the axes of the world changes as it turns, so D is computed anew every 6 degrees.

    Args:
        plant: What is moved, at home, with the Jacobian rows of the rotation.
        stiffnesses: Of the position [N/m] and of the orientation [N m/rad].
        damping_ratio: r.
        posture_hz: Natural frequency of redundant joints.

    Attributes:
        fastest: Frequency of the fastest mode at home [rad/s].
        lags: By which the modes follow a ramp at home, the shortest first [s].
        strength: The stiffnesses, for a message.
    """

    def __init__(self, plant: Plant, stiffnesses: tuple[float, float], damping_ratio: float, posture_hz: float) -> None:
        along, about = stiffnesses
        self._roots = np.sqrt([along] * 3 + [about] * 3)
        self._ratio = damping_ratio
        self._plant = plant
        self._turned = np.zeros(4)
        self._home = self._damped_at = self._orientation()
        frequencies, self._damping = self._modes()
        self.fastest = float(frequencies[-1])
        self.lags: list[float] = (2.0 * damping_ratio / frequencies[::-1]).tolist()
        self.strength = f"{along:g} N/m and {about:g} N m/rad"
        self._along, self._about = along, about
        self._goal = self._home
        self._speed = plant.data.qvel
        self._wrench, self._twist = np.zeros(6), np.zeros(6)
        self._joints = JointTorques(plant, len(frequencies), posture_hz)

    def reset(self) -> None:
        """Hold the orientation at home again."""
        self._goal = self._home
        if self._damped_at != self._home:
            self._damped_at, (_, self._damping) = self._home, self._modes()

    def point(self, orientation: Quaternion) -> None:
        """Set the orientation to hold, from that at home, axes of the world; ValueError keeps the last one."""
        held = unit_quaternion(orientation)
        if held is None:
            raise ValueError(f"mujoco: commanded an orientation that is none: {orientation}")
        self._goal = product(held, self._home)

    def too_strong(self, excess: float) -> str:
        """Error message for stiffnesses of which one is too large by this factor."""
        return (
            f"stiffness_n_m, rotation.stiffness_n_m_rad: with them the end effector swings at "
            f"{self.fastest / (2.0 * pi):.2g} Hz, too much for its mass or its inertia; "
            f"divide the one that does by {1.05 * excess:.2g}"
        )

    def apply(self, commanded: Vector) -> None:
        """Set the joint torques for the state of the last `refresh` of the plant."""
        plant, wrench, k = self._plant, self._wrench, self._along
        x, y, z = plant.position.tolist()
        turned = self._orientation()
        turn = vector(product(self._goal, inverse(turned)))
        wrench[0], wrench[1], wrench[2] = k * (commanded[0] - x), k * (commanded[1] - y), k * (commanded[2] - z)
        k = self._about
        wrench[3], wrench[4], wrench[5] = k * turn[0], k * turn[1], k * turn[2]
        (aw, ax, ay, az), (bw, bx, by, bz) = turned, self._damped_at
        if abs(aw * bw + ax * bx + ay * by + az * bz) < STILL_ALIKE:
            self._damped_at, (_, self._damping) = turned, self._modes()
        plant.twist.dot(self._speed, self._twist)
        wrench -= self._damping.dot(self._twist)
        self._joints.apply(wrench, plant.twist)

    def _modes(self) -> tuple[Array, Array]:
        """Frequencies of the free modes, the slowest first [rad/s], and D, at the last `refresh` of the plant."""
        plant, roots = self._plant, self._roots
        mobility = plant.twist @ plant.inverse_mass() @ plant.twist.T
        squares, modes = np.linalg.eigh(roots[:, None] * mobility * roots)
        free = squares > IMMOBILE * squares[-1]
        frequencies = np.sqrt(squares[free])
        shapes = roots[:, None] * modes[:, free]
        return frequencies, (shapes * (2.0 * self._ratio / frequencies)) @ shapes.T

    def _orientation(self) -> Quaternion:
        mujoco.mju_mat2Quat(self._turned, self._plant.turned)
        w, x, y, z = self._turned.tolist()
        return (w, x, y, z)


class TorqueSensing(Protocol):
    """Reads the torque [N m] of the last step, about the tip and in the world frame."""

    def torque(self) -> Vector: ...


def torque_sensing(plant: Plant, name: str) -> TorqueSensing:
    """The sensing that the option `rotation.torque` names.

    Raises:
        ValueError: the file has no such sensor, or no force sensor on the same site.
    """
    return ContactTorque(plant) if name == CONTACTS else SensorTorque(plant, plant.torque_sensor(name))


class ContactTorque:
    """The sum over all contacts of the end effector: r x f of each about the tip, and its own torque."""

    def __init__(self, plant: Plant) -> None:
        self._sensing = ContactSensing(plant)
        self._contacts, self._tip = plant.data.contact, plant.position

    def torque(self) -> Vector:
        tx = ty = tz = 0.0
        ox, oy, oz = self._tip.tolist()
        places = self._contacts.pos.tolist()
        for number, (x, y, z), (d, e, f), (nx, ny, nz, sx, sy, sz, ux, uy, uz) in self._sensing.contacts():
            px, py, pz = places[number]
            px, py, pz = px - ox, py - oy, pz - oz
            tx += py * z - pz * y + d * nx + e * sx + f * ux
            ty += pz * x - px * z + d * ny + e * sy + f * uy
            tz += px * y - py * x + d * nz + e * sz + f * uz
        return (tx, ty, tz)


class SensorTorque:
    """A `<torque>` sensor of the file, referred to the tip, less the torque of the weight of what hangs on it.

    The sensor gives the torque that holds the body of its site, about that site. The force sensor on the same site
    gives what the change of the reference point adds. Inertia is not subtracted, as for the force.
    """

    def __init__(self, plant: Plant, sensor: int) -> None:
        model, data = plant.model, plant.data
        address, site = int(model.sensor_adr[sensor]), int(model.sensor_objid[sensor])
        self._force = SensorSensing(plant, plant.force_sensor_on(site))
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
