"""An MJCF file as a plant: model, state, end effector, and the degrees of freedom that move it."""

from collections.abc import Iterable
from difflib import get_close_matches
from math import inf
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from weberlink.geometry.vector import Vector
from weberlink_mujoco.arms.models import Array, compiled, read

CLOSE_ENOUGH = 1e-6  # distance at which a point counts as reached [m]
ITERATIONS = 500
LONGEST_STRIDE = 0.02  # of the end effector in one iteration of inverse kinematics [m]


class Plant:
    """The model of a file, ready to be stepped.

    The degrees of freedom of the robot are those of the kinematic tree of the end effector; other bodies that move are
    what it may touch. Actuators of the file, and gravity compensation of the robot, are switched off: the position
    control replaces them. `keyframe` is the initial state; None for joints at 0. `turns`: the Jacobian of the rotation
    is computed too. Raises ValueError, in one line that begins with the option that is wrong.
    """

    def __init__(self, path: Path, end_effector: str, keyframe: str | None, *, turns: bool = False) -> None:
        self.model: Any = _model(path)  # its arrays of fixed size, and those of `data`, are views and may be kept
        self.data: Any = mujoco.MjData(self.model)
        self.path = path
        self.site = self._number("end_effector", "site", end_effector)
        self.body = int(self.model.site_bodyid[self.site])
        self._keyframe = None if keyframe is None else self._number("keyframe", "key", keyframe)
        self.dofs = self._tree_dofs(end_effector)
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
        self.model.body_gravcomp[self.model.body_treeid == self.model.dof_treeid[self.dofs.start]] = 0.0
        self.position: Array = self.data.site_xpos[self.site]
        self.turned: Array = self.data.site_xmat[self.site]  # rows of a rotation matrix
        self.twist: Array = np.zeros((6 if turns else 3, self.model.nv))  # rows of position, then perhaps of rotation
        self.jacobian: Array = self.twist[:3]
        self._spin: Array | None = self.twist[3:] if turns else None
        self._warnings: Any = self.data.warning.number
        self.home: Array = self.model.qpos0.copy()
        if self._keyframe is not None:
            self.home[:] = self.model.key_qpos[self._keyframe]
        self.reset()
        moving = np.linalg.norm(self.jacobian, axis=1)
        self.axes = "".join(axis for axis, way in zip("xyz", moving, strict=True) if way > 1e-9 * moving.max())

    def sensor(self, option: str, quantity: str, name: str) -> int:
        """Number of a sensor of `force` or `torque`, which an option names; ValueError if there is none."""
        kind = mujoco.mjtSensor.mjSENS_FORCE if quantity == "force" else mujoco.mjtSensor.mjSENS_TORQUE
        there = {self.model.sensor(i).name: i for i in self._sensors(kind)}
        return there[name] if name in there else _unknown(option, f"{quantity} sensor", name, there)

    def force_sensor_on(self, site: int) -> int:
        """Number of the force sensor on a site; raises ValueError if there is none."""
        for sensor in self._sensors(mujoco.mjtSensor.mjSENS_FORCE):
            if self.model.sensor_objid[sensor] == site:
                return sensor
        name = self.model.site(site).name
        raise ValueError(
            f"rotation.torque: the torque sensor is on the site {name!r}, which has no force sensor beside it; "
            f'add <force site="{name}"/>, without which the torque about the tip is not known'
        )

    def reset(self) -> None:
        """Everything at rest in the initial state, the robot at `home`."""
        if self._keyframe is None:
            mujoco.mj_resetData(self.model, self.data)
        else:
            mujoco.mj_resetDataKeyframe(self.model, self.data, self._keyframe)
        self.data.qpos[:] = self.home
        self.data.qvel[:] = 0.0
        self.refresh()

    def refresh(self) -> None:
        """Compute what follows from positions and velocities: `position`, `jacobian`, contacts, bias."""
        mujoco.mj_step1(self.model, self.data)
        mujoco.mj_jacSite(self.model, self.data, self.jacobian, self._spin, self.site)

    def advance(self, step: float) -> None:
        """Move on by `step` [s] under `data.qfrc_applied`; the forces of the step can then be read, until `refresh`."""
        self.model.opt.timestep = step
        mujoco.mj_step2(self.model, self.data)

    def inverse_mass(self) -> Array:
        """M^-1 of all degrees of freedom, in the pose of the last `refresh`."""
        inverse: Array = np.eye(self.model.nv)
        mujoco.mj_solveM(self.model, self.data, inverse, np.eye(self.model.nv))
        return inverse

    def warning(self) -> str | None:
        """The first warning of MuJoCo since `reset`, after which the motion cannot be trusted."""
        counts = self._warnings.tolist()
        if not any(counts):
            return None
        kind = next(kind for kind, count in enumerate(counts) if count)
        return " ".join(mujoco.mju_warningText(kind, self.data.warning[kind].lastinfo).split())

    def _sensors(self, kind: Any) -> list[int]:
        return [sensor for sensor in range(self.model.nsensor) if self.model.sensor_type[sensor] == kind]

    def _number(self, option: str, kind: str, name: str) -> int:
        entries = getattr(self.model, f"n{kind}")
        there = {getattr(self.model, kind)(i).name: i for i in range(entries)}
        return there[name] if name in there else _unknown(option, {"key": "keyframe"}.get(kind, kind), name, there)

    def _tree_dofs(self, end_effector: str) -> slice:
        """Those of one kinematic tree, which are contiguous in MuJoCo."""
        body = self.body
        while body and not self.model.body_dofnum[body]:
            body = int(self.model.body_parentid[body])
        if not body:
            raise ValueError(f"end_effector: no joint moves the site {end_effector!r}")
        tree = self.model.dof_treeid[self.model.body_dofadr[body]]
        members = np.flatnonzero(self.model.dof_treeid == tree)
        return slice(int(members[0]), int(members[-1]) + 1)


def _model(path: Path) -> Any:
    if not path.is_file():
        raise ValueError(f"model: there is no file {path}")
    return compiled(read(path), path)


def _unknown(option: str, kind: str, name: str, there: Iterable[str]) -> int:
    names = sorted(filter(None, there))
    if not names:
        raise ValueError(f"{option}: the model has no {kind} with a name, so none is called {name!r}")
    nearest = get_close_matches(name, names, n=1, cutoff=0.0)[0]
    raise ValueError(f"{option}: no {kind} is called {name!r}; nearest is {nearest!r}, there are {', '.join(names)}")


def settle(plant: Plant, goal: Vector) -> None:
    """Make a pose with the end effector at `goal` [m] the plant's home, by damped least squares from the present pose;
    ValueError if none is found within the joint limits.
    """
    model, data, dofs = plant.model, plant.data, plant.dofs
    target = np.array(goal)
    turn: Array = np.zeros(model.nv)
    simple = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    nearest = inf
    for _ in range(ITERATIONS):
        missing = target - plant.position
        length = float(np.linalg.norm(missing))
        nearest = min(nearest, length)
        if length < CLOSE_ENOUGH:
            break
        jacobian = plant.jacobian[:, dofs]
        square = jacobian @ jacobian.T
        square.flat[::4] += 1e-6 * square.trace()
        stride = missing * min(1.0, LONGEST_STRIDE / length)
        turn[dofs] = jacobian.T @ np.linalg.solve(square, stride)
        mujoco.mj_integratePos(model, data.qpos, turn, 1.0)
        for joint in np.flatnonzero(model.jnt_limited):
            if int(model.jnt_type[joint]) in simple:
                address = model.jnt_qposadr[joint]
                data.qpos[address] = np.clip(data.qpos[address], *model.jnt_range[joint])
        plant.refresh()
    else:
        raise ValueError(f"home_m: the end effector comes no closer than {nearest:.2g} m to {list(goal)}")
    plant.home[:] = data.qpos
    plant.reset()
