"""The errors of an arm's joints and gripper against their deadbands, which hold for each axis alone."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from weberlink.config.joints import per_axis
from weberlink.figures.channel import ErrorStatistics
from weberlink.figures.energy import Records, Series
from weberlink.geometry.joints import Joints
from weberlink.telemetry.record import JOINTS

GRIPPER = slice(len(JOINTS) - 1, len(JOINTS))
"""Place of the gripper in the vectors of a record."""


class Thresholds(NamedTuple):
    """What may stay unsent of an axis a: the larger of `weber` |a| and its floor.

    Args:
        floors: of each axis [rad | N m].
        weber: Weber factor; None for that of each record, which a live change may have set.
        predictor: of the channel.
    """

    floors: Joints
    weber: float | None
    predictor: str

    def of(self, actual: Series, sender: Records) -> Series:
        """The deadband of each axis at each tick, shape (n, axes); `actual` is what `sender` measured."""
        weber = sender["weber"][:, None] if self.weber is None else self.weber
        deadbands: Series = np.maximum(weber * np.abs(actual.astype(np.float64)), np.asarray(self.floors))
        return deadbands


@dataclass(frozen=True)
class ArmLayout:
    """The axes of a session in joint space, and their deadbands.

    Args:
        names: of the joints.
        angle, torque: of the joints.
        gripper_angle, gripper_torque: of the gripper; None without one.
    """

    names: tuple[str, ...]
    angle: Thresholds
    torque: Thresholds
    gripper_angle: Thresholds | None = None
    gripper_torque: Thresholds | None = None

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of all axes: the joints in order, then the gripper where there is one."""
        return self.names if self.gripper_angle is None else (*self.names, JOINTS[-1])

    @property
    def places(self) -> list[int]:
        """Column of each of these axes in the vectors of a record."""
        joints = list(range(len(self.names)))
        return joints if self.gripper_angle is None else [*joints, GRIPPER.start]

    def torque_deadbands(self, slave: Records) -> Series:
        """What may stay unsent of the torque of each axis at each tick [N m], shape (n, axes)."""
        channels = [(self.torque, slice(0, len(self.names)))]
        channels += [] if self.gripper_torque is None else [(self.gripper_torque, GRIPPER)]
        return np.hstack([thresholds.of(slave["joint_raw"][:, axes], slave) for thresholds, axes in channels])

    def channels(self, period: float) -> tuple[dict[str, "AxesScore"], dict[str, "AxesScore"]]:
        """The scores of the channels from the slave, and of those from the master."""
        joints = slice(0, len(self.names))
        from_slave = {"joint_torque": AxesScore(joints, self.names, self.torque, period, reports_coding=True)}
        from_master = {"joint_angle": AxesScore(joints, self.names, self.angle, period)}
        if self.gripper_torque is not None and self.gripper_angle is not None:
            from_slave["gripper_torque"] = AxesScore(GRIPPER, JOINTS[-1:], self.gripper_torque, period)
            from_master["gripper_angle"] = AxesScore(GRIPPER, JOINTS[-1:], self.gripper_angle, period)
        return from_slave, from_master


def arm_in(dump: Mapping[str, Any]) -> ArmLayout | None:
    """The layout in the dump of a `System`, as descriptions and recordings hold it; None without an arm.

    Raises:
        ValueError: it says something else of joints than this release does.
    """
    try:
        codec = dump["codec"]
        joints, gripper = codec.get("joints"), codec.get("gripper")
        if joints is None:
            return None
        names = tuple(joints["names"])
        layout = ArmLayout(names, _angle(joints, len(names)), _torque(joints, len(names)))
        if gripper is None:
            return layout
        grip = _torque(gripper, 1)._replace(weber=gripper["torque"]["weber"])
        return replace(layout, gripper_angle=_angle(gripper, 1), gripper_torque=grip)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no settings of joints ({error!r})") from None


def _angle(settings: Mapping[str, Any], count: int) -> Thresholds:
    angle = settings["angle"]
    return Thresholds(_floors(angle["bound_rad"], count), 0.0, angle["predictor"])


def _torque(settings: Mapping[str, Any], count: int) -> Thresholds:
    torque = settings["torque"]
    return Thresholds(_floors(torque["floor_nm"], count), None, torque["predictor"])


def _floors(setting: Any, count: int) -> Joints:
    return per_axis(tuple(setting) if isinstance(setting, list) else setting, count)


class AxesScore:
    """Errors of some axes: what the receiver commanded against what the sender measured at the same time.

    The error of a tick is that of the axis with the largest one, in its unit and in deadbands.

    Args:
        axes: their places in the vectors of a record.
        names: of them.
        thresholds: their deadbands.
        period: of a tick [s].
        reports_coding: whether the sender's own error is reported too.
    """

    def __init__(
        self,
        axes: slice,
        names: tuple[str, ...],
        thresholds: Thresholds,
        period: float,
        *,
        reports_coding: bool = False,
    ) -> None:
        self._axes, self._names, self._thresholds, self._period = axes, names, thresholds, period
        self._sent = "gripper_sent" if axes == GRIPPER else "sent"
        self._reports_coding = reports_coding
        self.felt, self._coding = ErrorStatistics(), ErrorStatistics()
        self._squares = np.zeros(len(names))
        self._largest = np.zeros(len(names))
        self._sends = self._ticks = self._widened = 0

    def add_sender(self, records: Records, in_session: Records) -> None:
        """Take the next records of the sender, and those of them that are in session and not in a ramp."""
        self._ticks += len(in_session)
        if self._axes != GRIPPER:
            self._widened += int((in_session["widened"] > 0).sum())
        self._sends += int((records[self._sent] > 0).sum())
        if self._reports_coding and len(in_session):
            errors, deviations = self._errors(in_session["joint_decoded"], in_session)
            self._coding.add(errors.max(axis=1), np.ones(len(errors)), deviations)

    def compare(self, sender: Records, receiver: Records) -> None:
        """Take records of the same moments."""
        if not len(sender):
            return
        errors, deviations = self._errors(receiver["joint_output"], sender)
        self._squares += (errors * errors).sum(axis=0)
        self._largest = np.maximum(self._largest, errors.max(axis=0))
        self.felt.add(errors.max(axis=1), np.ones(len(errors)), deviations)

    def summary(self) -> dict[str, object]:
        count = self.felt.count
        summary: dict[str, object] = dict(self.felt.summary(self._period))
        summary["widened_fraction"] = self._widened / self._ticks if self._ticks else None
        summary["widened_max"] = None
        summary["selected"] = {self._thresholds.predictor: self._sends}
        if self._reports_coding:
            summary["coding"] = self._coding.summary(self._period)
        summary["axes"] = {
            name: {"error_rms": float((square / count) ** 0.5), "error_max": float(largest)} if count else None
            for name, square, largest in zip(self._names, self._squares, self._largest, strict=True)
        }
        return summary

    def _errors(self, displayed: Series, sender: Records) -> tuple[Series, Series]:
        """Errors of each axis, shape (n, axes), and the largest of each row in deadbands, shape (n,)."""
        actual = np.asarray(sender["joint_raw"][:, self._axes], dtype=np.float64)
        errors = np.abs(np.asarray(displayed[:, self._axes], dtype=np.float64) - actual)
        return errors, (errors / self._thresholds.of(actual, sender)).max(axis=1)
