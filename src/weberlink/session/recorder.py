"""Facts that a recording states of its session, and the check of its target before the start."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from weberlink.config import Configuration, ConfigurationError
from weberlink.figures.environment import environment
from weberlink.protocol.states import State
from weberlink.session.composition.channels import banks
from weberlink.session.targets import TargetError, check_file
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.recorders import COMPLETE, Recorder, RecordingFormat, format_of

FINISH_LIMIT_S = 10.0
"""Time to write remaining records and the index after the daemons have ended; then the recorder is told to finish.

Ordinary work goes before the recorder, so that a busy host may leave it little time.
"""
RANGE = ("lower_rad", "upper_rad")
"""Facts of a session of arms: the range of the follower's commanded angles, axis by axis; where it was known."""


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
    from weberlink.session.composition.following import angle_limits, build_follower  # noqa: PLC0415 - for arms alone

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


def format_for(path: Path) -> RecordingFormat:
    """The format of a recording to be made, with its target checked before anything is started.

    Raises:
        ConfigurationError: it exists, cannot be written, or no format is installed.
    """
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
