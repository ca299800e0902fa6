"""A session of arms as the monitor tells it: its axes, rows, felt error, packets and history."""

import json

import numpy as np
import pytest

from tests.apps import arm_sessions as arms
from tests.watching.sources import HandSource
from weberlink.system.scoring.arm import arm_in
from weberlink.system.scoring.session import SessionScore
from weberlink.watching.rows import CARTESIAN
from weberlink.watching.session import WatchedSession

TICKS = 2000
CHANNELS = ("joint_torque", "joint_angle", "gripper_torque", "gripper_angle")


@pytest.fixture(scope="module")
def made() -> dict[str, np.ndarray]:
    return {side: arms.records(side, TICKS) for side in ("master", "slave")}


@pytest.fixture
def watched(made: dict[str, np.ndarray]) -> tuple[WatchedSession, list[dict]]:
    """A session that was looked at, and what it told."""
    sources = {side: HandSource(side) for side in made}
    for side, source in sources.items():
        source.description = {"side": side, "system": arms.SYSTEM, "bank": ["zoh"], "changes": ["weber"]}
        source.put(made[side])
    session = WatchedSession("7", sources["slave"])
    session.admit(sources["master"])
    return session, session.look()


def message(told: list[dict], kind: str, side: str | None = None) -> dict:
    (found,) = (each for each in told if (each["type"], each.get("side")) == (kind, side))
    return found


def test_greeting_names_the_axes(watched: tuple[WatchedSession, list[dict]]) -> None:
    hello = watched[0].hello()
    assert hello["axes"] == [*arms.NAMES, "gripper"]
    assert hello["settings"]["weber"] == 0.13 and hello["scene"] == []
    alone = WatchedSession("8", HandSource("slave"))
    assert alone.hello()["axes"] is None


def test_rows_have_the_axes_of_the_arm(watched: tuple[WatchedSession, list[dict]], made: dict) -> None:
    for side in ("master", "slave"):
        rows = message(watched[1], "samples", side)
        json.dumps(rows, allow_nan=False)
        ticks = np.rint(np.array(rows["t"]) * arms.RATE).astype(int)
        assert not set(CARTESIAN) & set(rows["columns"])
        for name in ("joint_position", "joint_raw", "joint_output"):
            shown = np.array(rows["columns"][name])
            np.testing.assert_allclose(shown.T, made[side][name][ticks][:, list(arms.PLACES)], atol=1e-6)
        assert {0, arms.SENT_EVERY, arms.GRIPPER_SENT_EVERY} <= set(ticks.tolist())
    bound = np.array(rows["columns"]["joint_bound"])
    torque = np.abs(np.array(rows["columns"]["joint_raw"]))
    np.testing.assert_allclose(bound, np.maximum(0.13 * torque, 0.02), atol=1e-6)


def test_felt_error_is_that_of_the_worst_axis(watched: tuple[WatchedSession, list[dict]], made: dict) -> None:
    felt = message(watched[1], "felt")
    ticks = np.rint(np.array(felt["t"]) * arms.RATE).astype(int)
    places = list(arms.PLACES)
    actual = made["slave"]["joint_raw"][ticks][:, places].astype(float)
    error = np.abs(made["master"]["joint_output"][ticks][:, places] - actual)
    expected = (error / np.maximum(0.13 * np.abs(actual), 0.02)).max(axis=1)
    assert expected.max() > 0.1
    np.testing.assert_allclose(felt["deadbands"], expected, atol=1e-3)


def test_packets_are_told_by_channel(watched: tuple[WatchedSession, list[dict]], made: dict) -> None:
    figures = watched[0].figures()
    now = figures["packets_per_s_now"]
    assert set(now) == set(CHANNELS)
    for channel in CHANNELS:
        every = arms.GRIPPER_SENT_EVERY if channel.startswith("gripper") else arms.SENT_EVERY
        assert now[channel] == pytest.approx(arms.RATE / every, rel=0.03)
        assert figures["reduction_now"][channel] == pytest.approx(1.0 - 1.0 / every, abs=0.002)
    score = SessionScore(arms.RATE, ("zoh",), arm=arm_in(arms.SYSTEM))
    score.add(made["master"], made["slave"])
    for channel in CHANNELS:
        for name in ("packets", "error_rms", "violation_fraction"):
            assert figures["figures"][channel][name] == score.summary()[channel][name], name
