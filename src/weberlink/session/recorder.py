"""The recording of a session: the facts that it states, the check of its target, and its writer in virtual time."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml

from weberlink.config import MASTER, SLAVE, Configuration, ConfigurationError
from weberlink.environment import environment
from weberlink.protocol.states import State
from weberlink.session.composition.channels import banks
from weberlink.session.description import RANGE
from weberlink.session.targets import TargetError, check_file
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import Records
from weberlink.telemetry.recorders import COMPLETE, Recorder, RecordingFormat, format_of

FINISH_LIMIT_S = 10.0
"""Time to write remaining records and the index after the daemons have ended; then the recorder is told to finish.

Ordinary work goes before the recorder, so that a busy host may leave it little time."""


def facts(configuration: Configuration, *, virtual: bool = False) -> dict[str, str]:
    """Metadata for readers of a recording: the whole configuration, and the names of numbers in the records."""
    system = configuration.system
    force, torque = banks(system)
    described: dict[str, Any] = {"system": system.model_dump(mode="json"), "bank": force, "torque_bank": torque}
    if system.codec.joints is not None and configuration.robot is not None:
        from weberlink.session.composition.arms import angle_limits, build_follower  # noqa: PLC0415 - for arms

        described |= zip(RANGE, angle_limits(system, build_follower(configuration).spec), strict=True)
    return facts_of(described, virtual=virtual)


def facts_of(description: Mapping[str, Any], *, virtual: bool = False) -> dict[str, str]:
    """The same from the description of a running daemon, which leaves out the path of the key."""
    torque = description.get("torque_bank")
    return {
        "configuration": yaml.safe_dump(dict(description["system"]), sort_keys=False),
        "bank": " ".join(description["bank"]),
        **({} if torque is None else {"torque_bank": " ".join(torque)}),
        "states": " ".join(f"{state.value}={state.name.lower()}" for state in State),
        "faults": " ".join(f"{fault.value}={fault.name.lower()}" for fault in Fault),
        "clock": "virtual" if virtual else "real",
        "environment": json.dumps(environment()),
        **{name: " ".join(map(str, description[name])) for name in RANGE if name in description},
    }


def format_for(path: Path) -> RecordingFormat:
    """The format of a recording to be made, with its target checked before anything is started; raises
    ConfigurationError if it exists, cannot be written, or no format is installed."""
    try:
        found = format_of(path, "--record")
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    try:
        check_file(path)
    except TargetError as error:
        raise ConfigurationError(f"--record: {error}") from None
    if path.exists():
        raise ConfigurationError(f"--record: {path} exists; recordings are never overwritten, give another name")
    return found


def recording_ended(path: Path | str, outcome: str) -> str:
    """The line that says at once that nothing more is recorded."""
    return f"recording stopped: {outcome}; the session goes on, and {path} holds what was recorded until now"


def failure(recorder: Recorder) -> str | None:
    """The line that says why a recording is not whole; None if it is. Waits until it is finished."""
    outcome = recorder.finish()["outcome"]
    return None if outcome == COMPLETE else f"the recording failed: {outcome}"


class VirtualRecording:
    """Writes the recording of a live session, on a clock that begins at 0. A full disk ends the recording alone. Raises
    ConfigurationError from the constructor, if the file cannot be made."""

    def __init__(self, configuration: Configuration, path: Path, tell: Callable[[str], None]) -> None:
        self._outcome, self._path, self._tell = COMPLETE, path, tell
        try:
            self._writer = format_for(path).create(
                path, facts(configuration, virtual=True), configuration.system.rate_hz
            )
        except OSError as error:
            raise ConfigurationError(f"--record: {path}: {error.strerror or error}") from None

    def add(self, master: Records, slave: Records) -> None:
        if self._outcome == COMPLETE:
            try:
                self._writer.write(MASTER, master)
                self._writer.write(SLAVE, slave)
                self._writer.flush()
            except OSError as error:
                self._outcome = error.strerror or str(error)
                self._tell(recording_ended(self._path, self._outcome))

    def finish(self) -> dict[str, Any]:
        """End the file; returns the summary that the recorder of a live session gives."""
        try:
            self._writer.close()
        except OSError as error:
            self._outcome = error.strerror or str(error)
        writer = self._writer
        figures = {"path": str(self._path), "bytes": writer.size, "records": writer.records, "lost": writer.lost}
        return figures | {"outcome": self._outcome}
