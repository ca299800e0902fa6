"""`python -m trials.foxglove`: Foxglove's own packages read the live view of running sessions, set parameters, and read
the pictures of a recording.

The client (judge.cjs) is made of packages by Foxglove, installed by `make foxglove`. Prints what it found, and exits
with status 1 if a law was violated.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from time import monotonic, sleep
from typing import Any, Self

import numpy as np
from _pytest.outcomes import Failed
from PIL import Image

from tests.laws import Laws, write
from tests.program import PATIENT, Program
from tests.wait import until
from trials.rig import Command, Loopback
from weberlink.session.control_socket import ask
from weberlink.telemetry.ring import default_path
from weberlink_recording.reader import read_recording
from weberlink_ros2.markers import DELETE_ALL
from weberlink_video.pattern import time_in

HERE = Path(__file__).parent
PACKAGES = Path(".venv/foxglove/node_modules")
CARTESIAN = {
    "/weberlink/hand": "geometry_msgs/msg/PoseStamped",
    "/weberlink/robot": "geometry_msgs/msg/PoseStamped",
    "/weberlink/felt": "geometry_msgs/msg/WrenchStamped",
    "/weberlink/measured": "geometry_msgs/msg/WrenchStamped",
    "/weberlink/bodies": "visualization_msgs/msg/MarkerArray",
    "/weberlink/scene": "visualization_msgs/msg/MarkerArray",
    "/tf": "tf2_msgs/msg/TFMessage",
}
ARMS = {f"/weberlink/{name}": "sensor_msgs/msg/JointState" for name in ("leader", "follower")}
EVERY = {
    "/weberlink/master": "weberlink_msgs/msg/Tick",
    "/weberlink/slave": "weberlink_msgs/msg/Tick",
    "/weberlink/felt_error": "weberlink.FeltError",
    "/weberlink/log": "rcl_interfaces/msg/Log",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
BRIDGE = ("bridge", "foxglove", "--port", 0)

Event = dict[str, Any]


class Judge:
    """The client, dead at the end of the `with`; `options` as of judge.cjs."""

    def __init__(self, url: str, folder: Path, *options: str) -> None:
        self._said = folder / f"judge-{monotonic()}"
        with self._said.open("w") as out:
            self._process = subprocess.Popen(
                ["node", str(HERE / "judge.cjs"), url, *options],
                stdin=subprocess.PIPE,
                stdout=out,
                stderr=subprocess.STDOUT,
                text=True,
                env={**os.environ, "NODE_PATH": str(PACKAGES.resolve())},
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._process.kill()
        self._process.wait()

    def command(self, **what: Any) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(what) + "\n")
        self._process.stdin.flush()

    @property
    def events(self) -> list[Event]:
        lines = self._said.read_text().splitlines(keepends=True)
        return [json.loads(line) for line in lines if line.startswith("{") and line.endswith("\n")]

    def next(self, kind: str, after: int, is_it: Callable[[Event], object] = lambda _: True) -> Event:
        """The first event of a kind after so many events."""

        def look() -> Event | None:
            return next((e for e in self.events[after:] if e["event"] == kind and is_it(e)), None)

        try:
            found = until(look, f"{kind} of the judge")
        except Failed:
            write(f"the judge: {self._process.poll()} {self._said.read_text()[-2000:]}")
            raise
        assert found is not None
        return found

    def asked(self, kind: str, **what: Any) -> Event:
        """The first event of a kind after a command."""
        after = len(self.events)
        self.command(**what)
        return self.next(kind, after)

    def until_all(self, wanted: Iterable[str]) -> None:
        """Wait until every one of these topics has brought something; lateness counts from then on."""

        def complete() -> bool:
            report = self.report()
            return all(report[name]["checked"] for name in wanted)

        until(complete, "a message of each topic")
        self.command(settle=True)

    def report(self) -> dict[str, Event]:
        topics: dict[str, Event] = self.asked("report", report=True)["topics"]
        return topics


def right(laws: Laws, topics: dict[str, Event], wanted: dict[str, str]) -> None:
    """Every message of these topics is read whole by its schema, and there are some."""
    for name in wanted:
        found = topics[name]
        law = f"{name}: every message fits its schema"
        laws.check(law, found["checked"] > 0 and not found["wrong"], found["why"] or found["checked"])
    for side in ("master", "slave"):
        found = topics[f"/weberlink/{side}"]
        missed = found["last"]["ticks_missed"] - found["first"]["ticks_missed"]
        whole = found["count"] > 0 and found["skipped"] == missed
        laws.check(f"{side}: no tick is lost on the way", whole, f"{found['count']} ticks")
        write(f"       from its deadline to the client [ms]: {found['late_ms']}")


def cartesian(laws: Laws, folder: Path) -> None:
    """A session of hand and robot: all topics, and parameters set by one client and seen by others."""
    with Loopback("--set", "link.emulate={}", *PATIENT) as program:
        mine = ("--session", program.pid)
        with Command(*BRIDGE, *mine, "--allow-changes") as bridge:
            url = bridge.until_said(r"(ws://\S+)")
            bridge.until_said("slave at")
            with Judge(url, folder) as judge, Judge(url, folder, "parameters") as other:
                types = judge.next("topics", 0)["types"]
                laws.check("topics have their types", types == CARTESIAN | ARMS | EVERY, len(types))
                other.next("server", 0)
                judge.until_all(CARTESIAN | EVERY)
                sleep(5.0)
                right(laws, judge.report(), CARTESIAN | EVERY)
                parameters(laws, judge, other, program.pid)
            os.kill(bridge.pid, signal.SIGKILL)
        sleep(1.0)
    outcome = program.summary["outcome"]
    laws.check("the session does not notice that the bridge is killed", outcome == "interrupted", outcome)


def parameters(laws: Laws, judge: Judge, other: Judge, session: int) -> None:
    """What is set is in force, or refused with the daemon's reason; everyone is told."""
    names = ["delay_ms", "jitter_ms", "loss", "predictor", "weber"]
    laws.check("parameters are there", sorted(judge.asked("parameters", get=[])["values"]) == names)
    other.command(watch=names)
    sleep(2.5)
    seen = len(other.events)
    for name, value in (("weber", 0.2), ("predictor", "linear"), ("delay_ms", 5)):
        told = judge.asked("parameters", set={name: value})["values"]
        laws.check(f"{name} can be set", told == {name: value}, told)
        other.next("parameters", seen, lambda event, n=name, v=value: event["values"].get(n) == v)  # type: ignore[misc]
    laws.check("the other client is told of them", True)
    for name, value in (("weber", 1.2), ("predictor", "best"), ("loss", "much"), ("gain", 2)):
        after = len(judge.events)
        told = judge.asked("status", set={name: value})["text"]
        back = judge.next("parameters", after)["values"]
        laws.check(f"{name} = {value!r} is refused", value not in back.values(), told)
    ring = default_path(f"{session}-slave")
    seen = len(other.events)
    answer = ask(ring, {"weber": 0.15})
    laws.check("the page can change it too", answer["accepted"])
    other.next("parameters", seen, lambda event: event["values"].get("weber") == 0.15)
    laws.check("a client is told of a change from elsewhere", True)
    sleep(0.5)
    laws.check("the ticks show what is in force", judge.report()["/weberlink/slave"]["last"]["weber"] == 0.15)


def arms(laws: Laws, folder: Path) -> None:
    """A session of arms after a short one of hand and robot: the client stays."""
    with Command(*BRIDGE) as bridge:
        url = bridge.until_said(r"(ws://\S+)")
        with Judge(url, folder) as judge:
            judge.next("topics", 0)
            with Program("loopback", "--duration", 3, *PATIENT) as program:
                program.finish()
            with Program("loopback", "plugins/arms/configs/arms.yaml", "--duration", 20, *PATIENT) as program:
                bridge.until_said(f"session {program.pid}: slave at")
                judge.until_all(ARMS)
                sleep(2.0)
                topics = judge.report()
                refused = judge.asked("status", set={"weber": 0.2})["text"]
                laws.check("without --allow-changes, parameters are read-only", "--allow-changes" in refused, refused)
                program.finish()
            right(laws, topics, ARMS)
            (last,) = topics["/weberlink/scene"]["last"]["markers"]
            laws.check("the scene of one session gives way to that of the next", last["action"] == DELETE_ALL)
            errors = [event["text"] for event in judge.events if event["event"] == "error"]
            laws.check("the client met no error", not errors, errors[:1])


def recorded(laws: Laws, folder: Path) -> None:
    """The pictures of a recording: Foxglove's reader of MCAP has the very ones of ours, each stamped as it shows."""
    path, judge = folder / "recording.mcap", ["node", str(HERE / "recording.cjs")]
    with Program(
        "loopback", "plugins/video/configs/video.yaml", "--duration", 5, "--record", path, *PATIENT
    ) as program:
        program.finish()
    env = {**os.environ, "NODE_PATH": str(PACKAGES.resolve())}
    said = subprocess.run([*judge, str(path)], capture_output=True, text=True, check=True, env=env).stdout
    theirs = [json.loads(line) for line in said.splitlines()]
    ours = read_recording(path, with_pictures=True).pictures
    whole = [(each["stamp"], each["logged"], each["format"], each["digest"]) for each in theirs]
    own = [(str(each.wall_ns), str(each.wall_ns), "jpeg", sha256(each.jpeg).hexdigest()) for each in ours]
    laws.check("Foxglove's reader has the pictures of a recording", len(own) > 50 and whole == own, len(whole))
    greys = (np.asarray(Image.open(BytesIO(each.jpeg)).convert("L")) for each in ours)
    offsets = [1e-6 * each.wall_ns - 1e3 * (time_in(grey) or 0.0) for each, grey in zip(ours, greys, strict=True)]
    apart_ms = max(offsets) - min(offsets)
    laws.check("each is stamped with the time that it shows", apart_ms < 2.0, f"{apart_ms:.2f} ms apart at most")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.parse_args()
    laws = Laws()
    with tempfile.TemporaryDirectory() as folder:
        cartesian(laws, Path(folder))
        arms(laws, Path(folder))
        recorded(laws, Path(folder))
    for law in laws.broken:
        write(f"BROKEN {law}")
    return 1 if laws.broken else 0


if __name__ == "__main__":
    sys.exit(main())
