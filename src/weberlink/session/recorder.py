"""The recording of a session: what it is told of the session, the check of its target, and what is said of its end."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from weberlink.config import Configuration, ConfigurationError
from weberlink.session.composition.channels import banks
from weberlink.session.description import RANGE
from weberlink.session.targets import TargetError, check_file
from weberlink.telemetry.recorders import COMPLETE, Recorder, RecordingFormat, VirtualRecording, format_of

FINISH_LIMIT_S = 10.0
"""Time to write remaining records and the index after the daemons have ended; then the recorder is told to finish.

Ordinary work goes before the recorder, so that a busy host may leave it little time."""


def described(configuration: Configuration) -> dict[str, Any]:
    """What a recording says of its session: the whole configuration, and the names of numbers in the records."""
    system = configuration.system
    force, torque = banks(system)
    told: dict[str, Any] = {"system": system.model_dump(mode="json"), "bank": force, "torque_bank": torque}
    if system.codec.joints is not None and configuration.robot is not None:
        from weberlink.session.composition.arms import angle_limits, build_follower  # noqa: PLC0415 - for arms

        told |= zip(RANGE, angle_limits(system, build_follower(configuration).spec), strict=True)
    return told


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


def virtual_recording(configuration: Configuration, path: Path, tell: Callable[[str], None]) -> VirtualRecording:
    """Begin the recording of a session in virtual time; raises ConfigurationError if the file cannot be made."""
    try:
        return format_for(path).create(path, described(configuration), tell)
    except OSError as error:
        raise ConfigurationError(f"--record: {path}: {error.strerror or error}") from None
