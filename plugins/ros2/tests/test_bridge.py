"""`bridge ros2`: what is published of the ticks of a session, and what the diagnostics tell."""

from collections.abc import Iterator
from pathlib import Path
from time import monotonic, time
from typing import Any

import numpy as np
import pytest

from plugins.figures.tests.sources import records, write
from plugins.ros2.tests.rigs import ring
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import FORCE, RELEASED
from weberlink_figures.message import ENCAPSULATION
from weberlink_figures.watching.rings import RingSource
from weberlink_ros2.bridge import Ros2Bridge
from weberlink_ros2.diagnostics import STALE_S, Level, SideCondition
from weberlink_ros2.follow import SessionFollower
from weberlink_ros2.messages import decode
from weberlink_ros2.names import Qos
from weberlink_ros2.topics import DIAGNOSTICS, DIAGNOSTICS_S, FRESH_S, wall_offset_s


class Publisher:
    def __init__(self, type_name: str) -> None:
        self.type_name, self.sequence, self.bodies = type_name, 0, list[bytes]()

    def put_body(self, cdr: bytes, stamp_ns: int) -> None:
        assert abs(stamp_ns - time() * 1e9) < 60e9
        self.sequence += 1
        self.bodies.append(cdr)

    @property
    def messages(self) -> list[Any]:
        return [decode(ENCAPSULATION + body, self.type_name) for body in self.bodies]


class Node:
    connections, is_router = 1, False

    def __init__(self) -> None:
        self.topics: dict[str, Publisher] = {}

    def publisher(self, topic: str, type_name: str, qos: Qos | None = None) -> Publisher:
        assert topic not in self.topics
        return self.topics.setdefault(topic, Publisher(type_name))


class Live:
    def __init__(self, folder: Path) -> None:
        self.folder, self.node, self.now = folder, Node(), 0.0
        bridge = Ros2Bridge(self.node, Qos(), None, print, wall_offset_s)  # type: ignore[arg-type]
        self.follower = SessionFollower(bridge, None, print, folder)

    def look(self) -> None:
        self.now += DIAGNOSTICS_S
        self.follower.look(self.now)

    def statuses(self) -> dict[str, Any]:
        return {status.name: status for status in self.node.topics[DIAGNOSTICS].messages[-1].status}


@pytest.fixture
def live(tmp_path: Path) -> Iterator[Live]:
    made = Live(tmp_path)
    yield made
    made.follower.close()


def ticks(count: int, *, first: int = 0) -> Records:
    """Ticks of now, whose values are noise."""
    made = records(count, first=first, seed=first + 1)
    made["at"] = monotonic() + 1e-3 * np.arange(count)
    return made


def test_every_new_tick_is_published_once_with_its_wall_clock(live: Live) -> None:
    with ring(live.folder, "master") as master:
        old = ticks(5)
        old["at"] -= 2 * FRESH_S
        made = [ticks(3, first=5), ticks(5, first=8)]
        write(master, old)  # what was before is left out
        for piece in made:
            write(master, piece)
            live.look()
    poses, wrenches, frames = (live.node.topics[f"/{name}"] for name in ("weberlink/hand", "weberlink/felt", "tf"))
    new = np.concatenate(made)
    for vectors, field in (
        ([each.pose.position for each in poses.messages], "position"),
        ([each.wrench.force for each in wrenches.messages], "output"),
    ):
        assert [[each.x, each.y, each.z] for each in vectors] == new[field][:, FORCE].tolist()
    named = [[each.child_frame_id for each in message.transforms] for message in frames.messages]
    assert named == [["hand", "felt"]] * 8
    at = np.array([each.header.stamp.sec + 1e-9 * each.header.stamp.nanosec for each in poses.messages])
    np.testing.assert_allclose(at, new["at"] + wall_offset_s(), atol=1.0)
    np.testing.assert_allclose(np.diff(at), np.diff(new["at"]), atol=1e-6)


def test_diagnostics_tell_state_and_fault(live: Live) -> None:
    live.look()
    assert live.statuses()["weberlink: bridge"].message == "waits for a session"
    with ring(live.folder, "master") as master, ring(live.folder, "slave") as slave:
        made = ticks(5)
        made["updates_sent"] = np.arange(5)
        write(master, made)
        write(slave, ticks(5))
        live.look()
        statuses = live.statuses()
        assert statuses["weberlink: bridge"].message == "publishes session 7"
        values = {pair.key: pair.value for pair in statuses["weberlink: master"].values}
        assert statuses["weberlink: master"].level == Level.OK
        assert "engaged" in statuses["weberlink: master"].message
        assert (values["state"], values["predictor"], values["round trip [ms]"]) == ("engaged", "zoh", "unknown")
        broken, held = ticks(1, first=5), ticks(1, first=5)
        broken["fault"], held["ramping"] = Fault.DEVICE.value, RELEASED
        write(slave, broken)
        write(master, held)
        live.look()
        statuses = live.statuses()
        assert statuses["weberlink: slave"].level == Level.ERROR and "robot" in statuses["weberlink: slave"].message
        assert statuses["weberlink: master"].level == Level.WARN
    live.look()
    live.look()
    assert [status.level for status in live.statuses().values()] == [Level.OK]


def test_a_side_that_stands_still_is_stale(live: Live) -> None:
    with ring(live.folder, "master") as master:
        source = RingSource(master.path)
        condition = SideCondition(source, 100.0)
        condition.take(ticks(3), 100.2)
        for at, level in ((100.2 + STALE_S - 0.1, Level.OK), (100.3 + STALE_S, Level.STALE)):
            assert condition.status(at).level == level
        source.drained = True  # without the mark of its end
        assert condition.status(102.0).level == Level.ERROR
        source.close()
