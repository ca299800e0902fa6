"""Frames of a LeRobot dataset from the records of both sides of a session.

The two sides run at 1 kHz, a dataset at 30 Hz. Each frame has the newest record of each side, and all records of the
time since the frame before as flat windows of a fixed length.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.protocol.states import State
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import FORCE
from weberlink_figures.channel import GRIPPER
from weberlink_figures.session import Layout
from weberlink_recording.session import RecordedSession

Numbers = NDArray[np.float32]
Stretches = list[tuple[float, float]]  # begins and ends, in order of time

LONGEST_GAP_S = 0.1
"""A side without records for longer than this ends an episode [s]; the value before a shorter gap is held."""
CONTACT_N = 0.05  # a force above this is one of a contact [N]
LONGEST_UNSEEN_S = 1.0  # cameras without a picture for longer than this end an episode too [s]
LEAST_FRAMES = 2  # a shorter stretch becomes no episode


@dataclass(frozen=True)
class Feature:
    """One feature: float32 values of shape (frames, width), and the names of their columns."""

    key: str
    names: tuple[str, ...]
    values: Numbers


@dataclass(frozen=True)
class Video:
    """The picture of a camera for each frame: the newest one that was taken by then, as JPEG."""

    camera: str
    jpegs: tuple[bytes, ...]


@dataclass(frozen=True)
class Frames:
    """The frames of all episodes, one after the other."""

    fps: int
    lengths: tuple[int, ...]  # frames of each episode, at least one episode
    times: NDArray[np.float64]  # of the frames, since the first record of the session [s]
    features: tuple[Feature, ...]  # each with a row for every frame
    lead_s: float  # time in which the leader led the follower; only this becomes frames [s]
    span_s: float  # length of the session [s]
    held: int  # records that were missing within an episode, and replaced by the one before
    videos: tuple[Video, ...] = ()  # of each camera that gave pictures


class _Signal(NamedTuple):
    """What a side contributes: a feature with the newest value, or none; one with the window; and the vector."""

    newest: str | None
    window: str
    side: str
    quantity: str
    vector: str


# `observation` and `action` are what policies read. What the operator's hand does and feels is neither.
_SIGNALS = (
    _Signal("observation.state", "observation.motion_window", "slave", "position", "position"),
    _Signal("action", "leader.motion_window", "master", "position", "raw"),
    _Signal(None, "observation.force_window", "slave", "force", "raw"),
    _Signal(None, "leader.force_window", "master", "force", "output"),
)


class NoFramesError(ValueError):
    """The session has no frame; one line that says why."""


def frames_of(session: RecordedSession, fps: int, gripper_rad: tuple[float, float] | None = None) -> Frames:
    """Cut a session into episodes, and those into frames.

    An episode is a stretch of time in which both sides were in session and the leader led: the approach at the
    beginning, a released button, silence of the link and gaps of the records are between episodes.

    Args:
        session: both sides on one clock.
        fps: frames per second, 1 to the rate of the ticks.
        gripper_rad: range of the gripper's angle; None if it is not known.

    Raises:
        NoFramesError: there is no such stretch, a side was not recorded, or a value is not finite.
    """
    if len(session.sides) < 2:
        (side,) = session.sides
        raise NoFramesError(f"holds the {side}'s side alone; give the recording of the other side of the session too")
    # As many ticks as the longest frame has, so that consecutive windows leave none out.
    per_frame = ceil(session.layout.rate_hz / fps - 1e-9)
    leads: Stretches = reduce(_common, [*map(_leads, session.sides.values()), *_seen(session)])
    frame_times = [times for lead in leads if len(times := _frame_times(session, lead, per_frame, fps)) >= LEAST_FRAMES]
    if not frame_times:
        raise NoFramesError(
            f"at no time of at least {LEAST_FRAMES} frames at {fps} Hz were both sides in session and the leader led"
        )
    times = np.concatenate(frame_times)
    windows = {
        side: _windows(records, times, per_frame, session.layout.rate_hz) for side, records in session.sides.items()
    }
    videos, ages = _videos(session, times)
    features = (*_features(session, windows, gripper_rad), *_contact(session, windows), *ages)
    for feature in features:
        if not np.isfinite(feature.values).all():
            raise NoFramesError(f"its values for {feature.key} are not all finite; not written by a daemon")
    first = min(float(records["at"][0]) for records in session.sides.values())
    return Frames(
        fps=fps,
        lengths=tuple(map(len, frame_times)),
        times=times - first,
        features=features,
        lead_s=sum(end - begin for begin, end in leads),
        span_s=max(float(records["at"][-1]) for records in session.sides.values()) - first,
        videos=tuple(videos),
        held=sum(_missing(records, each) for each in frame_times for records in session.sides.values()),
    )


def _leads(records: Records) -> Stretches:
    """The stretches in which a side was in session and nothing was faded, approached or released: begin and end."""
    is_led = (records["state"] == State.ENGAGED.value) & (records["ramping"] == 0)
    places = np.flatnonzero(is_led)
    at = records["at"][places]
    return _stretches(at, (np.diff(places) > 1) | (np.diff(at) > LONGEST_GAP_S))


def _stretches(at: NDArray[np.float64], cuts: NDArray[np.bool_]) -> Stretches:
    """Begins and ends of times in order, cut where that is asked for between two of them."""
    begins, ends = at[np.concatenate(([True], cuts))[: len(at)]], at[np.concatenate((cuts, [True]))[: len(at)]]
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def _seen(session: RecordedSession) -> Iterator[Stretches]:
    """For each camera, the stretches of time in which it gave pictures: begin and end."""
    for camera in sorted({picture.camera for picture in session.pictures}):
        at = np.array([picture.at for picture in session.pictures if picture.camera == camera])
        yield _stretches(at, np.diff(at) > LONGEST_UNSEEN_S)


def _common(one: Stretches, other: Stretches) -> Stretches:
    """The intervals that two sorted lists have in common."""
    common, ours, theirs = [], list(one), list(other)
    while ours and theirs:
        begin, end = max(ours[0][0], theirs[0][0]), min(ours[0][1], theirs[0][1])
        if begin < end:
            common.append((begin, end))
        (ours if ours[0][1] <= theirs[0][1] else theirs).pop(0)
    return common


def _frame_times(session: RecordedSession, lead: tuple[float, float], per_frame: int, fps: int) -> NDArray[np.float64]:
    """Times of the frames of a stretch, on the clock of the session; the first window begins with the stretch."""
    begin, end = lead
    at = session.master["at"]
    place = int(np.searchsorted(at, begin))
    first = float(at[place]) + (per_frame - 1) / session.layout.rate_hz
    count = int((end - first) * fps + 1e-6) + 1 if end >= first else 0
    return first + np.arange(count) / fps


def _windows(records: Records, times: NDArray[np.float64], per_frame: int, rate_hz: float) -> NDArray[np.intp]:
    """Places of the records of each frame, oldest first; shape (frames, per_frame).

    The last one is the newest record at the time of the frame, and the others are a tick apart. A tick without a record
    takes the record before.
    """
    at = records["at"]

    def held(when: NDArray[np.float64]) -> NDArray[np.intp]:
        """Places of the last records at these times; half a tick later counts as the same time."""
        return np.maximum(np.searchsorted(at, when + 0.5 / rate_hz, side="right") - 1, 0)

    return held(at[held(times)][:, None] - np.arange(per_frame - 1, -1, -1) / rate_hz)


def _features(
    session: RecordedSession, windows: dict[str, Any], gripper_rad: tuple[float, float] | None
) -> Iterator[Feature]:
    layout = session.layout
    forces = [
        f"{name}.{'force' if each.name == 'force' else 'torque'}" for each in layout.from_slave for name in each.names
    ]
    for signal in _SIGNALS:
        records, places = session.sides[signal.side], windows[signal.side]
        # Of a robot that a hand leads the place is not known, only where it was sent.
        is_sent = signal.vector == "position" and not layout.joints
        values = records["output" if is_sent else signal.vector][:, : len(layout.axes)]
        names: Sequence[str] = forces
        if signal.quantity == "position":
            names, values = _places(layout, values, gripper_rad)
        values = values.astype(np.float32)
        if signal.newest is not None:
            yield Feature(signal.newest, tuple(names), values[places[:, -1]])
        per_frame = places.shape[1]
        flat = values[places].reshape(len(places), -1)
        yield Feature(signal.window, tuple(f"{name}.{tick}" for tick in range(per_frame) for name in names), flat)


def _contact(session: RecordedSession, windows: dict[str, Any]) -> Iterator[Feature]:
    """For each tick of a frame, whether the robot touched something; of a robot whose tip is led."""
    if not session.layout.joints:
        touches = np.linalg.norm(session.slave["raw"][:, FORCE], axis=1) > CONTACT_N
        places = windows["slave"]
        values = touches[places].astype(np.float32)
        yield Feature("observation.contact_window", tuple(f"contact.{tick}" for tick in range(places.shape[1])), values)


def _videos(session: RecordedSession, times: NDArray[np.float64]) -> tuple[list[Video], list[Feature]]:
    """The pictures of each camera for the frames, and how old each is at its frame [s]."""
    videos, ages = [], []
    for camera in sorted({picture.camera for picture in session.pictures}):
        own = [picture for picture in session.pictures if picture.camera == camera]
        taken = np.array([picture.at for picture in own])
        newest = np.searchsorted(taken, times, side="right") - 1
        name = "".join(letter if letter.isalnum() else "_" for letter in camera)
        videos.append(Video(f"observation.images.{name}", tuple(own[place].jpeg for place in newest.tolist())))
        ages.append(Feature(f"session.age.{name}", ("age_s",), (times - taken[newest]).astype(np.float32)[:, None]))
    return videos, ages


def _places(
    layout: Layout, values: NDArray[np.float64], gripper_rad: tuple[float, float] | None
) -> tuple[list[str], NDArray[np.float64]]:
    """Names and values of places in the units of LeRobot: joints in degrees, the gripper from 0 to 100 of its range.

    Without its range the gripper keeps its radians and has another name, so that no robot takes these for its units.
    """
    names, scaled = [f"{name}.pos" for name in layout.axes], np.degrees(values) if layout.joints else values
    if GRIPPER in layout.joints[-1:]:
        if gripper_rad is None:
            names[-1], scaled[:, -1] = "gripper.rad", values[:, -1]
        else:
            closed, opened = gripper_rad
            scaled[:, -1] = 100.0 * (values[:, -1] - closed) / (opened - closed)
    return names, scaled


def _missing(records: Records, times: NDArray[np.float64]) -> int:
    """Ticks without a record within an episode."""
    begin, end = np.searchsorted(records["at"], (times[0], times[-1]))
    ticks = records["tick"][begin:end]
    return int(ticks[-1] - ticks[0]) + 1 - len(ticks) if len(ticks) else 0
