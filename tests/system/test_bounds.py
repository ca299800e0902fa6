"""What a file asks beyond device, robot and rate: refused, or said before a run with advice that ends the warning."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.system.systems import CONFIGS, configuration
from weberlink.control.passivity import passivity_limit
from weberlink.slave.robots.virtual import STIFFEST, UNSTATED
from weberlink.system.advice import Parts, advise
from weberlink.system.check import describe
from weberlink.system.composition import coupling as coupling_module
from weberlink.system.composition.coupling import FIT_MARGIN, coupling, press_limit
from weberlink.system.composition.master import build_device
from weberlink.system.composition.slave import build_robot
from weberlink.system.composition.trial import try_out
from weberlink.system.configuration import ConfigurationError

DAMPING = 8.0
"""Of the hand of the shipped file [N s/m]."""
DISPLAYED = 3000.0
"""Stiffness that its device displays [N/m]."""


def notes(*overrides: str) -> list[str]:
    """What is said of a file before a run; `check` says the same."""
    loaded = configuration(*overrides)
    said = advise(try_out(loaded))
    checked = [line.removeprefix("warning   ") for line in describe(loaded) if line.startswith("warning")]
    assert said == checked
    return checked


def refusal(*overrides: str) -> str:
    with pytest.raises(ConfigurationError) as raised:
        notes(*overrides)
    return str(raised.value)


@pytest.mark.parametrize(("count", "warns"), [(2, True), (3, False)])
def test_polling_daemons_need_a_processor_each_and_one_more(
    count: int, warns: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _pid: set(range(count)))
    assert any("realtime.busy_poll" in note for note in notes("realtime.busy_poll=true")) is warns


def with_stiffness(part: Any, stiffness: float) -> Any:
    part.spec = replace(part.spec, stiffness_n_m=stiffness)
    return part


def test_the_default_file_has_nothing_to_say() -> None:
    assert notes() == []


# --- warnings


@pytest.mark.parametrize(
    ("overrides", "key", "words", "followed"),
    [
        (
            ["slave.robot.stiffness_n_m=4000", "control.scheme=none"],
            "slave.robot.stiffness_n_m 4000",
            ["displays at most 3000 N/m;", "control.scheme none does not bound the energy"],
            ["slave.robot.stiffness_n_m=2500"],
        ),
        (
            ["master.device.hand.damping_n_s_m=3"],
            "slave.robot.stiffness_n_m 2500",
            ["displays at most 2000 N/m passively, b > K T (1/2 + 1) + B;", "raise rate_hz to 1250"],
            ["slave.robot.stiffness_n_m=1600"],
        ),
        (
            ["rate_hz=100", "link.silence_ms=200"],
            "slave.robot.stiffness_n_m 2500",
            ["at rate_hz 100", "at most 530 N/m passively", "raise rate_hz to 469"],
            ["slave.robot.stiffness_n_m=440"],
        ),
        (
            ["slave.scene.1.damping_n_s_m=20"],
            "slave.scene.1.damping_n_s_m",
            ["20 N s/m are felt on a device and hand of 8 N s/m", "gives energy", "use less than 8"],
            ["slave.scene.1.damping_n_s_m=2"],
        ),
        (
            ["slave.scene.0.damping_n_s_m=40", "slave.scene.0.stiffness_n_m=5000"],
            "slave.scene.0.damping_n_s_m",
            ["20 N s/m are felt", "use less than 16"],
            ["slave.scene.0.damping_n_s_m=4"],
        ),
        (
            ["master.device.hand.damping_n_s_m=0"],
            "master.device.hand.damping_n_s_m 0",
            ["no wall is passive"],
            ["master.device.hand.damping_n_s_m=8"],
        ),
        (
            ["codec.position.bound_m=0.001"],
            "codec.position.bound_m 0.001",
            ["may press 2.5 N", "deadband of the largest force (1 N)", "use at most 0.0004"],
            ["codec.position.bound_m=0.0004"],
        ),
        (
            ["codec.position.step_m=0.00002"],
            "codec.position.step_m 2e-05",
            ["half a step is 0.025 N", "codec.force.floor_n", "use at most 1.6e-05"],
            ["codec.position.step_m=1.6e-5"],
        ),
        (
            ["link.emulate.delay_ms=10", "control.scheme=none"],
            "control.scheme none",
            ["a round trip of 20 ms", "bears 14 ms", "use bounded"],
            ["control.scheme=bounded"],
        ),
        (
            ["slave.limits.trip_n=40"],
            "slave.limits.trip_n 40",
            ["at most 30 N", "never trips"],
            ["slave.limits.trip_n=30"],
        ),
        (
            ["master.mapping.walls={stiffness_n_m: 4000, box_m: [[-0.06, 0.06], [-0.06, 0.06], [-0.06, 0.06]]}"],
            "master.mapping.walls.stiffness_n_m 4000",
            ["at most 3000 N/m"],
            ["master.mapping.walls.stiffness_n_m=3000"],
        ),
        (["codec.force.floor_n=0"], "codec.force.floor_n 0", ["every tick"], ["codec.force.floor_n=0.02"]),
        (["codec.force.weber=0.5"], "codec.force.weber 0.5", ["use at most"], ["codec.force.weber=0.27"]),
        (
            ["codec.force.trust.stiffness_n_m=[10, 5000]"],
            "codec.force.trust.stiffness_n_m",
            ["3000 N/m of the device"],
            ["codec.force.trust.stiffness_n_m=[10, 3000]"],
        ),
        (
            ["rate_hz=10", "slave.robot.stiffness_n_m=40"],
            "link.silence_ms 100",
            ["shorter than 5 ticks", "use at least 500"],
            ["link.silence_ms=500"],
        ),
        (
            ["link.emulate={delay_ms: 230}"],
            "link.longest_round_trip_ms 400",
            ["round trip is up to 462 ms", "use at least 462"],
            ["link.longest_round_trip_ms=462"],
        ),
    ],
)  # fmt: skip
def test_a_warning_names_key_and_reason_and_what_it_advises_ends_it(
    overrides: list[str], key: str, words: list[str], followed: list[str]
) -> None:
    said = [line for line in notes(*overrides) if line.startswith(key)]
    assert len(said) == 1
    assert all(part in said[0] for part in words)
    assert notes(*overrides, *followed) == []


@given(
    damping=st.floats(0.1, 20.0),
    rate=st.floats(20.0, 5000.0),
    stiffness=st.floats(1.0, 1e6),
    wall_damping=st.floats(0.0, 5.0),
)
@examples(30)
def test_a_stiffness_is_warned_of_just_where_the_device_does_not_display_it(
    damping: float, rate: float, stiffness: float, wall_damping: float
) -> None:
    overrides = [
        f"master.device.hand.damping_n_s_m={damping!r}",
        f"rate_hz={rate!r}",
        f"slave.robot.stiffness_n_m={stiffness!r}",
        f"slave.scene.0.damping_n_s_m={wall_damping!r}",
        "link.silence_ms=1000",
    ]
    felt = wall_damping * min(1.0, stiffness / 500.0)
    most = min(DISPLAYED, passivity_limit(damping, 1.0 / rate, delay_ticks=1, wall_damping=felt))
    said = [line for line in advise(try_out(configuration(*overrides))) if line.startswith("slave.robot.stiffness_n_m")]
    assert len(said) == (0.0 < most < stiffness)


def test_a_wall_beyond_a_delay_is_warned_of_under_the_scheme_that_does_not_bound_energy() -> None:
    delay, none = "link.emulate.delay_ms=10", "control.scheme=none"
    passive = passivity_limit(DAMPING, 1e-3, delay_ticks=21)
    assert notes(delay, none, f"slave.robot.stiffness_n_m={0.999 * passive}") == []
    assert len(notes(delay, none, f"slave.robot.stiffness_n_m={1.001 * passive}")) == 1
    assert any("bears 0 ms" in line for line in notes(delay, none, "master.device.hand.damping_n_s_m=0"))


def test_the_bounds_are_those_in_the_frame_of_the_robot() -> None:
    """At twice the motion, the device's stiffness and damping are half of what they are at the hand."""
    trust = "codec.force.trust.stiffness_n_m=[10, 1500]"
    twice = ("master.mapping.scale=2", "codec.position.step_m=4e-6", trust)
    assert notes(*twice) == []
    assert build_robot(configuration(*twice)).spec.stiffness_n_m == DISPLAYED / FIT_MARGIN / 2.0
    said = notes(*twice, "slave.robot.stiffness_n_m=2000")
    assert len(said) == 1
    assert "displays at most 1500 N/m;" in said[0]
    said = notes(*twice, "master.device.hand.damping_n_s_m=3", "slave.robot.stiffness_n_m=1250")
    assert len(said) == 1
    assert "displays at most 1000 N/m passively" in said[0]


def test_a_robot_of_unstated_stiffness_is_said_to_press_without_limit() -> None:
    loaded = configuration("codec.position.bound_m=0.01")
    robot = build_robot(loaded)
    said = advise(Parts(loaded, build_device(loaded), with_stiffness(robot, inf)))
    assert said == ["slave.robot: point states no stiffness, so slave.limits.contact_n cannot act"]


# --- refusals


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("codec.force.weber=1", "codec.force.weber: should be less than 1"),
        ("codec.rotation.torque.weber=1", "codec.rotation.torque.weber: should be less than 1"),
        ("codec.position.bound_m=1", "codec.position.bound_m: should be less than or equal to 0.1"),
        ("codec.position.bound_m=0.06", "codec.position.bound_m 0.06: nothing would be sent, master.device reaches"),
        ("codec.force.floor_n=20", "codec.force.floor_n"),
        ("slave.limits.contact_n=0.04", "slave.limits.contact_n: should be greater than or equal to 0.05"),
        ("slave.limits.contact_n=31", "slave.limits.contact_n 31: point measures at most 30 N; use at most 30"),
        ("slave.limits.trip_n=0.04", "slave.limits.trip_n"),
        ("slave.limits.speed_m_s=101", "slave.limits.speed_m_s"),
        ("slave.limits.retract_m=2", "slave.limits.retract_m"),
        ("master.limits.force_n=0.04", "master.limits.force_n: should be greater than or equal to 0.05"),
        ("master.limits.force_n=2e4", "master.limits.force_n"),
        ("master.limits.slew_n_s=1e10", "master.limits.slew_n_s"),
        ("master.mapping.scale=1e-4", "master.mapping.scale"),
        ("master.mapping.walls.stiffness_n_m=2e9", "master.mapping.walls.stiffness_n_m"),
        ("control.allowance_j=0", "control.allowance_j"),
        ("control.refill_w=-1", "control.refill_w"),
        ("control.damping_n_s_m=-1", "control.damping_n_s_m"),
        ("control.rise_n_s=0", "control.rise_n_s"),
        ("rate_hz=9", "rate_hz"),
        ("rate_hz=10001", "rate_hz"),
        ("slave.scene.0.stiffness_n_m=2e9", "slave.scene.0.stiffness_n_m"),
        ("slave.scene.0.stiffness_n_m=1e-4", "slave.scene.0.stiffness_n_m"),
        ("slave.scene.0.damping_n_s_m=2e6", "slave.scene.0.damping_n_s_m"),
        ("slave.robot.stiffness_n_m=2e9", "slave.robot.stiffness_n_m"),
        ("slave.robot.stiffness_n_m=1e-4", "slave.robot.stiffness_n_m"),
        ("slave.robot.force_n=2e4", "slave.robot.force_n"),
        ("slave.robot={driver: simulated, mass_kg: 1e-7}", "slave.robot.mass_kg"),
        ("slave.robot={driver: simulated, mass_kg: 2000}", "slave.robot.mass_kg"),
        ("slave.robot={driver: simulated, damping_n_s_m: 2e6}", "slave.robot.damping_n_s_m"),
        ("master.device.force_n=2e4", "master.device.force_n"),
        ("master.device.stiffness_n_m=2e9", "master.device.stiffness_n_m"),
        ("master.device.hand.mass_kg=2000", "master.device.hand.mass_kg"),
        ("master.device.hand.mass_kg=1e-7", "master.device.hand.mass_kg"),
        ("master.device.hand.damping_n_s_m=2e6", "master.device.hand.damping_n_s_m"),
        ("master.device.hand.stiffness_n_m=2e9", "master.device.hand.stiffness_n_m"),
    ],
)  # fmt: skip
def test_what_is_out_of_range_is_refused_by_its_name(override: str, expected: str) -> None:
    assert expected in refusal(override)


UNITS = (
    "_kg",
    "_kg_m2",
    "_n",
    "_nm",
    "_n_m",
    "_n_m_rad",
    "_n_s",
    "_n_s_m",
    "_nm_s",
    "_n_m_s_rad",
    "_hz",
    "_m_s",
    "_rad_s",
    "_j",
)


def unbounded(node: Any, path: tuple[str, ...] = ()) -> Iterator[str]:
    """Numbers with a mechanical unit in their name that lack a lowest or a highest value, in a JSON schema."""
    if isinstance(node, list):
        for entry in node:
            yield from unbounded(entry, path)
    elif isinstance(node, dict):
        if node.get("type") in ("number", "integer") and path[-1].endswith(UNITS):
            low, high = ("minimum", "exclusiveMinimum"), ("maximum", "exclusiveMaximum")
            if not (any(map(node.__contains__, low)) and any(map(node.__contains__, high))):
                yield ".".join(path)
        for name, entry in node.items():
            in_it = path if name in ("anyOf", "oneOf", "items", "prefixItems", "properties", "$defs") else (*path, name)
            yield from unbounded(entry, in_it)


def test_every_number_with_a_mechanical_unit_has_a_range() -> None:
    schema = json.loads((CONFIGS / "weberlink.schema.json").read_text())
    assert list(unbounded(schema)) == []
    assert list(unbounded({"properties": {"mass_kg": {"anyOf": [{"type": "number", "minimum": 0}]}}})) == ["mass_kg"]


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (
            ("slave.limits.contact_n=8", "slave.limits.trip_n=5"),
            "slave.limits: contact_n 8 is above trip_n 5, at which the robot backs off",
        ),
        (
            ("slave.limits.contact_n=0.1", "codec.force.floor_n=0.2"),
            "slave.limits.contact_n: 0.1 is not felt; use at least codec.force.floor_n, 0.2",
        ),
        (
            ("master.limits.force_n=1", "master.mapping.force_scale=100"),
            "master.limits.force_n: leaves 0.01 N at the robot, less than a contact (0.05 N)",
        ),
    ],
)
def test_limits_that_contradict_each_other_are_refused(overrides: Sequence[str], expected: str) -> None:
    assert expected in refusal(*overrides)


# --- coupling and press limit


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        ((), DISPLAYED / FIT_MARGIN),
        (("slave.robot.stiffness_n_m=700",), 700.0),
        (("master.device.stiffness_n_m=600",), 500.0),
        (("master.mapping.scale=2",), DISPLAYED / FIT_MARGIN / 2.0),
        (("master.mapping.scale=0.5", "master.mapping.force_scale=4"), DISPLAYED / FIT_MARGIN / 2.0),
        (("master.device.stiffness_n_m=1e9", "master.mapping.scale=0.1"), STIFFEST),
    ],
)
def test_the_coupling_is_stated_or_follows_the_device(overrides: Sequence[str], expected: float) -> None:
    step = "codec.position.step_m=4e-6"
    loaded = configuration(*overrides, step)
    assert coupling(loaded) == pytest.approx(expected)
    assert build_robot(loaded).spec.stiffness_n_m == pytest.approx(expected)


def test_a_device_without_force_leaves_the_coupling_at_that_of_a_computed_robot() -> None:
    loaded = configuration()
    assert coupling(loaded, with_stiffness(build_device(loaded), 0.0)) == UNSTATED


def test_a_device_that_cannot_be_built_here_asks_for_a_stated_coupling(monkeypatch: pytest.MonkeyPatch) -> None:
    def unplugged(*_: object) -> None:
        raise ConfigurationError("master.device: no such port")

    monkeypatch.setattr(coupling_module, "construct", unplugged)
    with pytest.raises(
        ConfigurationError, match=r"slave.robot.stiffness_n_m: follows the device .* no such port.*set it"
    ):
        coupling(configuration())
    assert coupling(configuration("slave.robot.stiffness_n_m=700")) == 700.0


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        ((), 10.0),
        (("slave.limits.contact_n=4",), 4.0),
        (("slave.robot.force_n=6",), 6.0),
        (("master.mapping.force_scale=4",), 2.5),
    ],
)
def test_the_robot_presses_no_harder_than_stated_felt_or_measured(overrides: Sequence[str], expected: float) -> None:
    loaded = configuration(*overrides)
    assert press_limit(loaded.system, build_robot(loaded)) == expected
