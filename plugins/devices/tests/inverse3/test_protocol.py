"""The JSON of the Inverse Service: published messages, frames, and whatever else may come."""

import json
from collections.abc import Callable
from copy import deepcopy
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.hardware.fault import HardwareFault
from weberlink_devices.inverse3.filters import ALTERED_MOST, ForceComparison, ServiceSettings, settings_of
from weberlink_devices.inverse3.protocol import (
    FARTHEST_M,
    CommandWriter,
    ForceKey,
    check_status,
    choose,
    decode,
    our_orientation,
    ours,
    state_of,
    theirs,
)

PUBLISHED: dict[str, Any] = json.loads(Path(__file__).with_name("published.json").read_text(encoding="utf-8"))
INVENTORY, STATUS, PRESET, GRIP = (PUBLISHED[name] for name in ("inventory", "status", "preset", "grip"))
numbers = st.floats(-1e3, 1e3)
vectors = st.tuples(numbers, numbers, numbers)
documents = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=4,
)


def test_published_inventory_is_read() -> None:
    device = choose(INVENTORY, None)
    assert device["device_id"] == "049D"
    assert settings_of(device) == ServiceSettings(gate=0.3, damping=0.0)
    state = state_of(INVENTORY, "049D", "none")
    assert state == ((0.12, 0.0, 0.15), ZERO, None, 0), "ours: toward the operator, to the right, up"
    part = {"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"y": -0.1}}}]}
    assert state_of(part, "049D", "none").position == (0.1, 0.0, 0.0), "what is left out is its identity"


@pytest.mark.parametrize(("key", "message"), [("vector", "force_up"), ("values", "former_force_up")])
def test_force_command_is_the_published_one(key: ForceKey, message: str) -> None:
    assert json.loads(CommandWriter("049D", key).force(theirs((0.0, 0.0, 1.5)))) == PUBLISHED[message]


def test_first_message_names_the_session_once() -> None:
    writer = CommandWriter("049D", "vector")
    first = json.loads(writer.first(PRESET))
    assert first["session"]["configure"] == {"profile": {"name": "weberlink:master"}}
    assert first["session"]["force_render_full_state"] == {}
    (device,) = first["inverse3"]
    assert device["configure"] == PRESET
    assert device["commands"] == {"set_cursor_force": {"vector": {"x": 0.0, "y": 0.0, "z": 0.0}}}
    assert "session" not in json.loads(writer.force(ZERO))
    assert "configure" not in json.loads(CommandWriter("049D", "values").first({}))["session"]


@given(vectors)
@examples(50)
def test_frames_are_inverse_and_keep_right_hands(vector: Vector) -> None:
    assert ours(theirs(vector)) == theirs(ours(vector)) == vector
    assert [ours(axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))] == [
        (0.0, 1.0, 0.0),  # X, to the right, is our y
        (-1.0, 0.0, 0.0),  # Y, forward, is against our x
        (0.0, 0.0, 1.0),
    ]


def test_orientation_turns_about_the_same_axis_in_space() -> None:
    half = 0.5 * pi / 3.0
    assert our_orientation((1.0, 0.0, 0.0, 0.0)) == (1.0, 0.0, 0.0, 0.0), "level stays level"
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        x, y, z = (part * sin(half) for part in axis)
        w, *turned = our_orientation((cos(half), x, y, z))
        assert (w, *turned) == pytest.approx((cos(half), *(part * sin(half) for part in ours(axis))))


@pytest.mark.parametrize("name", ["calibrated", "ready", "power_supply"])
def test_unready_device_is_named(name: str) -> None:
    check_status({"status": STATUS}, "049D")
    with pytest.raises(HardwareFault, match="device 049D is "):
        check_status({"status": {**STATUS, name: False}}, "049D")


@pytest.mark.parametrize(
    ("config", "said"),
    [
        ({"basis": {"permutation": "XZY"}}, "permutes the axes"),
        ({"mount": {"scale": {"x": 2.0}}}, r"scales positions by \(2.0, 1.0, 1.0\)"),
    ],
)
def test_settings_that_turn_or_stretch_axes_raise(config: dict[str, Any], said: str) -> None:
    with pytest.raises(HardwareFault, match=said):
        settings_of({"config": config}).check()


@given(documents, st.sampled_from(["inverse3", "device", "state", "position", "x", "grip", "status", "config"]))
@examples(15)
def test_any_json_is_read_or_refused_in_one_line(document: Any, place: str) -> None:
    """Anything may stand at any place of a message."""
    message: dict[str, Any] = {**deepcopy(INVENTORY), "wireless_verse_grip": [deepcopy(GRIP)]}
    device = message["inverse3"][0]
    spots: dict[str, Callable[[], None]] = {
        "inverse3": lambda: message.update(inverse3=document),
        "device": lambda: message.update(inverse3=[document]),
        "state": lambda: device.update(state=document),
        "position": lambda: device["state"].update(cursor_position=document),
        "x": lambda: device["state"]["cursor_position"].update(x=document),
        "grip": lambda: message.update(wireless_verse_grip=[{"state": document}]),
        "status": lambda: device.update(status=document),
        "config": lambda: device["config"].update(filters=document, mount=document, basis=document),
    }
    spots[place]()
    try:
        state = state_of(decode(json.dumps(message).encode()), "049D", "wireless_verse_grip")
        settings_of(choose(message, "049D"))
    except HardwareFault as fault:
        assert "\n" not in str(fault)
    else:
        assert norm(state.position) <= FARTHEST_M


def test_other_force_is_named_after_a_while_unless_it_lags_by_two_commands() -> None:
    lagging, before = ForceComparison(), [ZERO, ZERO]
    for step in range(5 * ALTERED_MOST):
        before.append((0.0, 0.0, 2.0 * sin(0.5 * step)))
        assert lagging.judge(before[-1], before[-3]) is None
    assert ForceComparison().judge(ZERO, None) is None
    comparison = ForceComparison()
    push: Vector = (0.0, 0.0, 1.0)
    for _ in range(2 * ALTERED_MOST):
        assert comparison.judge(push, push) is None
    said = [comparison.judge(push, (0.0, 0.0, 0.3)) for _ in range(ALTERED_MOST)]
    assert said[:-1] == [None] * (ALTERED_MOST - 1)
    assert said[-1] == "the service displays (0.0, 0.0, 0.3) N instead of (0.0, 0.0, 1.0) N"
    assert comparison.judge(push, push) is None
