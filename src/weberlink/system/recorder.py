"""Run the recorder of a live session: a child process that reads the daemons' rings and writes an MCAP file.

Daemons and launcher never wait for it during a session; if it dies or the disk is full, only the recording ends.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from signal import SIGTERM
from subprocess import PIPE
from time import monotonic
from typing import Any

import yaml

from weberlink.child_process import Child, python
from weberlink.protocol.states import State
from weberlink.system.composition.channels import banks
from weberlink.system.configuration import Configuration, ConfigurationError
from weberlink.system.configuration.extras import need
from weberlink.system.environment import environment
from weberlink.system.targets import TargetError, check_file
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.message import BEGUN, COMPLETE, DURING, RANGE

FINISH_LIMIT_S = 10.0
"""Time to write remaining records and the index after the daemons have ended; then it is told to finish.

Ordinary work goes before the recorder, so that a busy host may leave it little time.
"""


def facts(configuration: Configuration, *, virtual: bool = False) -> dict[str, str]:
    """Metadata for readers of a recording: the whole configuration, and the names of numbers in the records.

    Args:
        configuration: with overrides and defaults.
        virtual: whether the session runs in virtual time.
    """
    system = configuration.system
    found = _facts(system.model_dump(mode="json"), *banks(system), virtual=virtual)
    if system.codec.joints is None or configuration.robot is None:
        return found
    from weberlink.system.composition.following import angle_limits, build_follower  # noqa: PLC0415 - for arms alone

    return found | _range(*angle_limits(system, build_follower(configuration).spec))


def facts_of(description: Mapping[str, Any]) -> dict[str, str]:
    """The same from the description of a running daemon, which leaves out the path of the key."""
    torque = description.get("torque_bank")
    found = _facts(description["system"], description["bank"], torque, virtual=False)
    return found | _range(*(description[name] for name in RANGE)) if RANGE[0] in description else found


def _range(lower: Sequence[float], upper: Sequence[float]) -> dict[str, str]:
    """The range of the commanded angles of a follower [rad], axis by axis."""
    return {name: " ".join(map(str, angles)) for name, angles in zip(RANGE, (lower, upper), strict=True)}


def _facts(
    system: Mapping[str, Any], force: Sequence[str], torque: Sequence[str] | None, *, virtual: bool
) -> dict[str, str]:
    return {
        "configuration": yaml.safe_dump(dict(system), sort_keys=False),
        "bank": " ".join(force),
        **({} if torque is None else {"torque_bank": " ".join(torque)}),
        "states": " ".join(f"{state.value}={state.name.lower()}" for state in State),
        "faults": " ".join(f"{fault.value}={fault.name.lower()}" for fault in Fault),
        "clock": "virtual" if virtual else "real",
        "environment": json.dumps(environment()),
    }


def check_target(path: Path) -> None:
    """Check the target of a recording before anything is started.

    Raises:
        ConfigurationError: it exists, cannot be written, or the library for recordings is missing.
    """
    need("mcap", "recording", "--record")
    try:
        check_file(path)
    except TargetError as error:
        raise ConfigurationError(f"--record: {error}") from None
    if path.exists():
        raise ConfigurationError(f"--record: {path} exists; recordings are never overwritten, give another name")


def recording_ended(path: Path | str, outcome: str) -> str:
    """The line that says at once that nothing more is recorded."""
    return f"recording stopped: {outcome}; the session goes on, and {path} holds what was recorded until now"


class Recorder:
    """The child process.

    Args:
        facts: see `facts`.
        rings: path of each side's ring; they need not exist yet.
        out: the file to write.
        since: moment on the clock of the records from which on to record [s]; None for all that the rings hold.
    """

    def __init__(
        self, facts: Mapping[str, str], rings: Mapping[str, str], out: Path, *, since: float | None = None
    ) -> None:
        from weberlink.telemetry.recording.recorder import RecordingOrder  # noqa: PLC0415 - reads and writes with an optional library

        self.path = out
        told = dict(facts) | ({} if since is None else {BEGUN: DURING})
        order = RecordingOrder(dict(rings), str(out), told, since=since, takes_commands=True)
        command = python("-m", "weberlink.telemetry.recording.recorder", order.to_json())
        self._process = Child(command, stdin=PIPE, stdout=PIPE)  # ends when the rings end
        self._summary: dict[str, Any] | None = None

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process runs; it ends early if it was killed or could not write."""
        return self._process.running

    def mark(self, text: str) -> None:
        """Set a mark at this moment; without effect if the process has ended."""
        self._process.write_line(json.dumps({"mark": text, "at": monotonic()}))

    def stop(self) -> None:
        """Tell it to finish the file; `running` then becomes false."""
        self._process.write_line(json.dumps({"finish": True}))

    def kill(self) -> None:
        """End it at once, if it does not finish; what it has written stays readable."""
        self._process.kill()

    def finish(self) -> dict[str, Any]:
        """Wait for a limited time until the file is complete; returns its summary. May be repeated."""
        if self._summary is None:
            self._summary = self._finish()
        return self._summary

    @property
    def failure(self) -> str | None:
        """The line that says why the recording is not whole; None if it is. Waits as `finish` does."""
        outcome = self.finish()["outcome"]
        return None if outcome == COMPLETE else f"the recording failed: {outcome}"

    def _finish(self) -> dict[str, Any]:
        output = self._process.end(FINISH_LIMIT_S, SIGTERM)
        try:
            summary: dict[str, Any] = json.loads(output)
        except ValueError:
            size = self.path.stat().st_size if self.path.exists() else 0
            summary = {"path": str(self.path), "bytes": size, "outcome": f"recorder {self._process.how_it_ended}"}
        return summary
