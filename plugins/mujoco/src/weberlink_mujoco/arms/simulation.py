"""The joints of an arm in motion: springs and dampers that hold them, torques from outside, and contact.

Imported by drivers when they are built; needs MuJoCo.
"""

from collections.abc import Sequence
from math import sqrt
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from weberlink.arms.contract import ArmFault
from weberlink.geometry.joints import Joints, is_finite
from weberlink_mujoco.arms.models import ArmModel, Array, compiled, read

if TYPE_CHECKING:
    from weberlink_mujoco.arms.follower import ArmObject

LONGEST_GAP = 0.1  # longest time that an arm moves on per call [s]; the rest of a longer silence is skipped
END_STOP_S = 0.004  # time constant in which an end stop pushes an axis back [s]
STRETCH = 0.25  # share by which a step may be longer, so that a tick that is a little late takes no additional step


class ArmSimulation:
    """Moves an arm whose joints hang on springs and dampers, the ends of which are led.

    M dv/dt = clip(k (goal - q) - d v) - b v + external + contact, with b the friction of the file and without gravity:
    the arm is compensated. Spring and damper are implicit (backward Euler; Tan, Liu and Turk, "Stable
    proportional-derivative controllers", IEEE CGA 31(4), 2011): with D = d + b,

        M (v' - v)/h = k (goal - q - h v') - D v'   <=>   (M + h D + h^2 k) (v' - v)/h = k (goal - q) - (D + h k) v

    so the matrix on the left is that of an arm with the armature raised by h D + h^2 k. The contact solver sees the
    same matrix, and no gain and no contact makes the arm unstable. A torque at its limit acts on the same raised
    inertia.

    `stiffness` is k [N m/rad], `damping` d [N m s/rad], `inertia` added to each axis [kg m^2], `limit` that of the
    torques of springs and dampers [N m], `step` the nominal h [s]; `objects` are what the arm may touch.
    """

    def __init__(
        self,
        model: ArmModel,
        *,
        stiffness: Joints,
        damping: Joints,
        inertia: Joints,
        limit: Joints,
        step: float,
        objects: Sequence["ArmObject"] = (),
    ) -> None:
        spec = read(model.path)
        for each in objects:
            each.add(spec, mujoco)
        self._model: Any = compiled(spec, model.path)
        self._axes = dofs = model.dofs
        self._step = step
        self._prepare()
        self._limit = np.array(limit)
        self._stiffness = np.array(stiffness)
        self._damping = np.array(damping) + self._model.dof_damping[dofs]
        self._passive = self._model.dof_damping[dofs].copy()
        self._own = self._model.dof_armature[dofs] + np.array(inertia)
        self._model.dof_damping[dofs] = 0.0
        self._rubbing = np.flatnonzero(self._model.dof_frictionloss[dofs])
        self._rows_before = np.count_nonzero(self._model.dof_frictionloss[: dofs.start])
        self._data: Any = mujoco.MjData(self._model)
        self._set_step(step)
        mujoco.mj_setConst(self._model, self._data)  # the weights of constraints follow from the raised inertia
        self._angles: Array = self._data.qpos[dofs]
        self._speeds: Array = self._data.qvel[dofs]
        self._applied: Array = self._data.qfrc_applied[dofs]
        self._constraint: Array = self._data.qfrc_constraint[dofs]
        self._lower, self._upper = np.array(model.lower), np.array(model.upper)
        self._sum: Array = np.zeros(len(stiffness))
        self.torque: Joints = (0.0,) * len(stiffness)  # mean of contacts and end stops in the last `advance` [N m]

    @property
    def angles(self) -> Joints:
        """[rad]"""
        return tuple(self._angles.tolist())

    @property
    def speeds(self) -> Joints:
        """[rad/s]"""
        return tuple(self._speeds.tolist())

    def reset(self, angles: Joints) -> None:
        """At rest at these angles [rad], and objects where they began."""
        mujoco.mj_resetData(self._model, self._data)
        self._data.xfrc_applied[:, :3] = self._weights
        self._angles[:] = np.clip(angles, self._lower, self._upper)
        mujoco.mj_forward(self._model, self._data)
        self.torque = (0.0,) * len(self.torque)

    def advance(self, goals: Joints, torques: Joints, elapsed: float) -> float:
        """Move on by `elapsed` [s], at most `LONGEST_GAP`, with springs that pull toward the goals, within the range
        [rad], and torques from outside [N m]; returns the time that the arm moved on. ArmFault if the motion is not
        finite.
        """
        elapsed = min(elapsed, LONGEST_GAP)
        count = max(1, round(elapsed / self._step + 0.5 - STRETCH))
        step = elapsed / count
        if abs(step - float(self._model.opt.timestep)) > 1e-9:
            self._set_step(step)
        goal = np.clip(goals, self._lower, self._upper)
        outside = np.array(torques)
        total = self._sum
        total[:] = 0.0
        try:
            with np.errstate(all="ignore"):  # checked below
                for _ in range(count):
                    self._advance(goal, outside)
        except mujoco.FatalError as error:
            raise ArmFault(f"mujoco: {' '.join(str(error).split())}") from None
        total /= count
        self.torque = tuple(total.tolist())
        if not (is_finite(self.torque) and is_finite(self.angles)):
            raise ArmFault("mujoco: the simulation of the arm is no longer finite")
        return elapsed

    def _advance(self, goal: Array, outside: Array) -> None:
        data, applied, speeds = self._data, self._applied, self._speeds
        np.subtract(goal, self._angles, applied)
        applied *= self._stiffness
        applied -= self._driven * speeds
        np.clip(applied, -self._limit, self._limit, applied)
        applied -= self._passive * speeds
        applied += outside
        mujoco.mj_step(self._model, data)
        self._sum += self._constraint
        if self._rubbing.size:
            first = data.ne + self._rows_before  # rows of friction follow those of equalities, by number of the axis
            self._sum[self._rubbing] -= data.efc_force[first : first + self._rubbing.size]

    def _set_step(self, step: float) -> None:
        self._model.opt.timestep = step
        self._driven = self._damping - self._passive + step * self._stiffness
        self._model.dof_armature[self._axes] = self._own + step * (self._damping + step * self._stiffness)

    def _prepare(self) -> None:
        """Replace what the file says of solving, actuators and gravity of the arm."""
        model, option = self._model, self._model.opt
        disabled = mujoco.mjtDisableBit
        for flag in (disabled.mjDSBL_ACTUATION, disabled.mjDSBL_AUTORESET, disabled.mjDSBL_SENSOR):
            option.disableflags |= flag
        option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        option.impratio = 10.0
        model.jnt_solref[model.dof_jntid[self._axes]] = (END_STOP_S, 1.0)
        others = model.body_treeid != model.dof_treeid[self._axes.start]
        self._weights: Array = np.outer(model.body_mass * others, option.gravity)
        option.gravity[:] = 0.0  # what is not of the arm gets its weight as a force: cheaper than to compensate the arm


def critical(model: ArmModel, angles: Joints, stiffness: Joints, ratio: float) -> Joints:
    """Damping that gives each axis alone this damping ratio, beside the friction of the file [N m s/rad].

    d = 2 r sqrt(k M_ii) - b, at least 0, in the pose `angles` [rad].
    """
    inertia = model.inertia(angles)
    return tuple(
        max(0.0, 2.0 * ratio * sqrt(k * m) - b) for k, m, b in zip(stiffness, inertia, model.damping, strict=True)
    )
