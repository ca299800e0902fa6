"""The rings of a session in joint space, filled by hand: a leader and a follower of two joints and a gripper."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

from weberlink.session.description import Description
from weberlink.telemetry.record import ALL
from weberlink.telemetry.ring import RingWriter
from weberlink.telemetry.row import Row

NAMES = ("pan", "lift")
REMOTE = {"driver": "remote_leader", "joints": NAMES, "gripper": True, "lower_rad": -1.0, "upper_rad": 1.0}
SYSTEM: dict[str, Any] = {
    "codec": {"joints": {"names": NAMES}, "gripper": {}},
    "master": {"device": REMOTE, "joint_mapping": None},
}
RANGES: dict[str, Any] = {
    "master": {"lower_rad": [-9.0, -9.0, -9.0], "upper_rad": [9.0, 9.0, 9.0]},
    "slave": {"lower_rad": [-1.0, -2.0, 0.0], "upper_rad": [1.0, 2.0, 0.5]},
}


class ArmRings:
    """The writers of both ends in one folder; every value tells its field, axis and tick."""

    def __init__(
        self, stack: ExitStack, folder: Path, session: str, system: dict[str, Any], ranges: dict[str, Any]
    ) -> None:
        self._writers = {}
        for side in ("master", "slave"):
            ring = folder / f"weberlink-{session}-{side}.ring"
            Description(ring, {"side": side, "system": system, **ranges.get(side, {})}).publish()
            writer = RingWriter(ring, side=side, rate_hz=1000.0, capacity=64)
            self._writers[side] = stack.enter_context(writer)

    def write(self, tick: int, at: float | None = None) -> None:
        """Add a record to each ring: joint i of a field is its place in the fields, plus i hundredths and the tick."""
        row = Row()
        row.tick, row.at = tick, monotonic() if at is None else at
        for place, field in enumerate(("position", "raw", "decoded", "output")):
            setattr(row, field, tuple(0.125 * place + (1 + i) / 128 + tick / 1024 for i in range(3)))
        for writer in self._writers.values():
            writer.write(ALL.values(row))

    def end(self, side: str) -> None:
        self._writers[side].close(unlink=False)


@contextmanager
def arm_rings(
    folder: Path, session: str = "77", system: dict[str, Any] = SYSTEM, ranges: dict[str, Any] = RANGES
) -> Iterator[ArmRings]:
    with ExitStack() as stack:
        yield ArmRings(stack, folder, session, system, ranges)
