"""Mechanical models of arms: kinematics, gravity, inertia and friction, computed by MuJoCo from an MJCF file.

Models come with distributions: entry points of the group `weberlink.arm_models`, each the path of its file.
"""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator

from weberlink.geometry.joints import MOST_JOINTS, Joints
from weberlink.geometry.vector import Vector
from weberlink.installation import absence
from weberlink.registry import Registry

Array = NDArray[np.float64]

MODELS: Registry[Path] = Registry("model of an arm", {}, "weberlink.arm_models")
ModelName = Annotated[str, AfterValidator(MODELS.check_known)]

GRIPPER = "gripper"  # name of the joint of a gripper
TIP = "tip"  # name of the site that marks the tip


def load(model: str | Path) -> "ArmModel":
    """A model by its name, or that of an MJCF file; ValueError, in one line, for one that cannot serve as an arm."""
    return ArmModel(model)


def mujoco() -> Any:
    """The package, which takes its time to import."""
    return import_module("mujoco")


class ArmModel:
    """A chain of joints, with a tip, and a gripper if it has one.

    The axes are the hinges of the kinematic tree of the site `tip` in the order of the file, except those that an
    equality makes follow another; one called `gripper` is the gripper and the last axis. All tuples have one entry for
    each axis. Not for several threads at once; raises as `load`.
    """

    def __init__(self, model: str | Path) -> None:
        self._mujoco = mujoco()
        self.path = path_of(model)
        self._model: Any = compiled(read(self.path), self.path)
        self._data: Any = self._mujoco.MjData(self._model)
        self._followers = self._coupled()
        joints = self._axes()
        self.labels: tuple[str, ...] = tuple(self._model.joint(i).name for i in joints)  # names of all axes
        self.gripper = self.labels[-1:] == (GRIPPER,)  # whether the last axis is one; 0 is closed
        self.names = self.labels[:-1] if self.gripper else self.labels  # of the joints in order, without the gripper
        self._check(joints)
        first = int(self._model.jnt_dofadr[joints[0]])
        self.dofs = slice(first, first + len(joints))  # of the axes in the vectors of MuJoCo
        ranges = self._model.jnt_range[joints].tolist()
        self.lower: Joints = tuple(low for low, _ in ranges)  # [rad]
        self.upper: Joints = tuple(high for _, high in ranges)  # [rad]
        self.torque: Joints = tuple(  # largest of the motors [N m]; infinite where the file has none
            float(self._model.jnt_actfrcrange[i][1]) if self._model.jnt_actfrclimited[i] else float("inf")
            for i in joints
        )
        # Inertia of the rotors behind their gears, part of `inertia` [kg m^2]; viscous friction [N m s/rad].
        self.armature: Joints = tuple(self._model.dof_armature[self.dofs].tolist())
        self.damping: Joints = tuple(self._model.dof_damping[self.dofs].tolist())
        self._force: Array = np.zeros(self._model.nv)
        self._jacobian: Array = np.zeros((3, self._model.nv))
        # Speeds of all degrees of freedom where one axis moves, as others follow; a row for each axis.
        self._moved: Array = np.eye(self._model.nv)[self.dofs]
        for dof, driver, ratio in self._followers:
            self._moved[:, dof] += ratio * self._moved[:, driver]
        self._placed: Joints = ()

    @property
    def axes(self) -> int:
        """Number of axes."""
        return len(self.lower)

    def gravity(self, angles: Joints) -> Joints:
        """Torques that hold the arm against gravity [N m]: dV/dq of its potential energy V, at these angles [rad]."""
        self._place(angles)
        self._mujoco.mj_rne(self._model, self._data, 0, self._force)
        return tuple((self._moved @ self._force).tolist())

    def jacobian(self, angles: Joints) -> tuple[Joints, Joints, Joints]:
        """Velocity of the tip along x, y, z for each axis [m/rad], in the frame of the file."""
        self._place(angles)
        self._mujoco.mj_jacSite(self._model, self._data, self._jacobian, None, self._tip)
        x, y, z = (tuple(row) for row in (self._jacobian @ self._moved.T).tolist())
        return x, y, z

    def tip(self, angles: Joints) -> Vector:
        """Position of the tip [m], in the frame of the file."""
        self._place(angles)
        x, y, z = self._data.site_xpos[self._tip].tolist()
        return x, y, z

    def inertia(self, angles: Joints) -> Joints:
        """Diagonal of the mass matrix [kg m^2], armature included."""
        return tuple([row[axis] for axis, row in enumerate(self.mass(angles))])

    def mass(self, angles: Joints) -> tuple[Joints, ...]:
        """The mass matrix, row by row [kg m^2], armature included."""
        self._place(angles)
        self._mujoco.mj_crb(self._model, self._data)
        rows: list[Joints] = []
        for speeds in self._moved:
            self._mujoco.mj_mulM(self._model, self._data, self._force, speeds)
            rows.append(tuple((self._moved @ self._force).tolist()))
        return tuple(rows)

    @property
    def _tip(self) -> int:
        return int(self._mujoco.mj_name2id(self._model, self._mujoco.mjtObj.mjOBJ_SITE, TIP))

    def _place(self, angles: Joints) -> None:
        if angles == self._placed:
            return
        self._placed = angles
        data = self._data
        data.qpos[self.dofs] = angles
        for dof, driver, ratio in self._followers:
            data.qpos[dof] = ratio * data.qpos[driver]
        self._mujoco.mj_kinematics(self._model, data)
        self._mujoco.mj_comPos(self._model, data)

    def _coupled(self) -> list[tuple[int, int, float]]:
        """Degrees of freedom that follow another, in proportion."""
        model = self._model
        of_joints = [i for i in range(model.neq) if model.eq_type[i] == self._mujoco.mjtEq.mjEQ_JOINT]
        ends = [(model.jnt_dofadr[model.eq_obj1id[i]], model.jnt_dofadr[model.eq_obj2id[i]]) for i in of_joints]
        ratios = [float(model.eq_data[i][1]) for i in of_joints]
        return [(int(dof), int(driver), ratio) for (dof, driver), ratio in zip(ends, ratios, strict=True)]

    def _axes(self) -> list[int]:
        """Numbers of the joints that are axes."""
        model, tip = self._model, self._tip
        if tip < 0:
            raise ValueError(f"model: {self.path}: expected a site with the name {TIP!r} at the tip of the arm")
        body = int(model.site_bodyid[tip])
        while body and not model.body_dofnum[body]:
            body = int(model.body_parentid[body])
        following = {dof for dof, _, _ in self._followers}
        hinge = int(self._mujoco.mjtJoint.mjJNT_HINGE)
        tree = model.dof_treeid[model.body_dofadr[body]] if body else -1
        return [
            joint
            for joint in range(model.njnt)
            if model.jnt_type[joint] == hinge
            and model.dof_treeid[model.jnt_dofadr[joint]] == tree
            and int(model.jnt_dofadr[joint]) not in following
        ]

    def _check(self, joints: list[int]) -> None:
        model, count, labels = self._model, len(self.names), list(self.labels)
        if not 1 <= count <= MOST_JOINTS or GRIPPER in self.names or not all(labels):
            raise ValueError(
                f"model: {self.path}: expected 1 to {MOST_JOINTS} hinges with names between the world and the site "
                f"{TIP!r}, one called {GRIPPER!r} after them if there is a gripper; found {labels}"
            )
        places = model.jnt_dofadr[joints]
        if (np.diff(places) != 1).any() or (model.jnt_qposadr[joints] != places).any():
            raise ValueError(f"model: {self.path}: expected the joints of the arm first and one after the other")
        if not model.jnt_limited[joints].all():
            free = labels[int(np.argmin(model.jnt_limited[joints]))]
            raise ValueError(f"model: {self.path}: expected a range at each joint; {free!r} has none")


def path_of(model: str | Path) -> Path:
    """The file of a model; raises ValueError if there is none."""
    name = Path(model).name
    path = MODELS[name] if str(model) in MODELS else Path(model)
    if path.is_file():
        return path
    if guest := MODELS.absent().get(name):
        raise ValueError(absence(f"model: {name!r}", guest))
    raise ValueError(f"model: there is no file {path}; expected one, or a name: {', '.join(MODELS)}")


def read(path: Path) -> Any:
    """An `MjSpec` of a file, to be changed and compiled; raises ValueError with one line for a wrong file."""
    package = mujoco()
    if package.get_mju_user_warning() is None:
        # In place of its printing and its MUJOCO_LOG.TXT; a simulation checks its own state.
        package.set_mju_user_warning(lambda _: None)
    return _in_one_line(lambda: package.MjSpec.from_file(str(path)), path)


def compiled(spec: Any, path: Path) -> Any:
    """The `MjModel` of a spec; raises ValueError with one line where it is wrong."""
    return _in_one_line(spec.compile, path)


def _in_one_line(make: Callable[[], Any], path: Path) -> Any:
    try:
        return make()
    except (ValueError, mujoco().FatalError) as error:
        raise ValueError(f"model: {path}: {' '.join(str(error).split())}") from None
