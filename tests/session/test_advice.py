"""What is said of a file before a run; and how stiff a robot is towards its command, and how hard it presses."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from tests.session.systems import CONFIGS, configuration
from weberlink.cli.check import describe
from weberlink.config import SLAVE, load
from weberlink.control.account import passivity_limit
from weberlink.protocol.keys import generate
from weberlink.session.advice import (
    TICK_SHARE,
    UNKNOWN_BORNE,
    USUAL_RATE_HZ,
    DryRun,
    advise,
    borne_round_trip,
    dry_run,
    measured_tick_s,
    on_measured_delay,
    placeholders,
    tick_rate,
    uncontrolled_delay,
)
from weberlink.session.composition.coupling import FIT_MARGIN, coupling, press_limit
from weberlink.session.composition.slave import build_robot
from weberlink.slave.robots.virtual import STIFFEST

DISPLAYED = 3000.0  # stiffness that its device displays [N/m]


def notes(*overrides: str) -> list[str]:
    """What is said of a file before a run; `check` says the same."""
    loaded = configuration(*overrides)
    said = advise(dry_run(loaded))
    assert said == [line.removeprefix("warning   ") for line in describe(loaded) if line.startswith("warning")]
    return said


WALLS = "master.mapping.walls={stiffness_n_m: 4000, box_m: [[-0.06, 0.06], [-0.06, 0.06], [-0.06, 0.06]]}"
WARNINGS: list[tuple[list[str], str, str, str]] = [
    (["master.device.hand.damping_n_s_m=3"], "slave.robot.stiffness_n_m 2500", "2000", "1600"),
    (["slave.scene.1.damping_n_s_m=20"], "slave.scene.1.damping_n_s_m", "use less than 8", "2"),
    (["master.device.hand.damping_n_s_m=0"], "master.device.hand.damping_n_s_m 0", "", "8"),
    (["codec.position.bound_m=0.001"], "codec.position.bound_m 0.001", "use at most 0.0004", "0.0004"),
    (["codec.position.step_m=0.00002"], "codec.position.step_m 2e-05", "use at most 1.6e-05", "1.6e-5"),
    (["link.emulate.delay_ms=10", "control.scheme=none"], "control.scheme none", "bears 14 ms", "bounded"),
    (["slave.limits.trip_n=40"], "slave.limits.trip_n 40", "30 N", "30"),
    ([WALLS], "master.mapping.walls.stiffness_n_m 4000", "3000", "3000"),
    (["codec.force.floor_n=0"], "codec.force.floor_n 0", "", "0.02"),
    (["codec.force.weber=0.5"], "codec.force.weber 0.5", "use at most", "0.27"),
    (["codec.force.trust.stiffness_n_m=[10, 5000]"], "codec.force.trust.stiffness_n_m", "3000", "[10, 3000]"),
    (["rate_hz=10", "slave.robot.stiffness_n_m=40"], "link.silence_ms 100", "use at least 500", "500"),
    (["link.emulate={delay_ms: 230}"], "link.longest_round_trip_ms 400", "use at least 462", "462"),
]
"""Overrides, the key that the one warning begins with, a figure in it, and a value of that key that ends it."""


@pytest.mark.parametrize(("overrides", "key", "figure", "followed"), WARNINGS)
def test_a_warning_names_key_and_figure_and_what_it_advises_ends_it(
    overrides: list[str], key: str, figure: str, followed: str
) -> None:
    (said,) = [line for line in notes(*overrides) if line.startswith(key)]
    assert figure in said
    assert notes(*overrides, f"{key.split(maxsplit=1)[0]}={followed}") == []


def test_the_bounds_are_those_in_the_frame_of_the_robot() -> None:
    """At twice the motion, the device's stiffness and damping are half of what they are at the hand."""
    twice = ("master.mapping.scale=2", "codec.position.step_m=4e-6", "codec.force.trust.stiffness_n_m=[10, 1500]")
    assert notes(*twice) == []
    (said,) = notes(*twice, "slave.robot.stiffness_n_m=2000")
    assert "1500" in said


# --- delay


@given(
    damping=st.floats(1.0, 30.0),
    wall=st.floats(50.0, 2000.0),
    wall_damping=st.floats(0.0, 0.9),
    rate=st.floats(100.0, 5000.0),
)
def test_none_bears_the_delay_up_to_which_hand_and_wall_are_passive(
    damping: float, wall: float, wall_damping: float, rate: float
) -> None:
    parts = dry_run(
        configuration(
            f"master.device.hand.damping_n_s_m={damping!r}",
            f"rate_hz={rate!r}",
            f"slave.scene=[{{shape: plane, stiffness_n_m: {wall!r}, damping_n_s_m: {wall_damping!r}}}]",
            "control.scheme=none",
            "link.silence_ms=1000",
        )
    )
    assert parts.robot is not None
    coupling, borne = parts.robot.spec.stiffness_n_m, borne_round_trip(parts)
    felt, felt_damping = min(wall, coupling), wall_damping * min(1.0, coupling / wall)
    limit = passivity_limit(damping, 1.0 / rate, delay_ticks=1.0 + borne * rate, wall_damping=felt_damping)
    assert limit == pytest.approx(felt) if borne > 0.0 else limit <= felt * (1.0 + 1e-9)
    assert uncontrolled_delay(parts, 0.999 * borne) is None
    assert uncontrolled_delay(parts, 1.001 * borne + 1e-6) is not None


def test_of_a_hand_that_is_not_known_none_bears_little() -> None:
    addresses = ("link.listen=127.0.0.1:47011", "link.slave=127.0.0.1:47011")
    assert borne_round_trip(dry_run(load(CONFIGS / "loopback.yaml", addresses, [SLAVE]))) == UNKNOWN_BORNE


@pytest.mark.parametrize(
    ("overrides", "round_trip", "is_said"),
    [
        (("control.scheme=none",), 0.05, True),
        (("control.scheme=none",), 0.001, False),
        (("control.scheme=none", "link.emulate.delay_ms=20"), 0.05, False),  # that of the file was said
        (("control.scheme=bounded",), 1.0, False),
    ],
)
def test_a_measured_delay_that_the_contact_does_not_bear_is_said(
    overrides: tuple[str, ...], round_trip: float, is_said: bool
) -> None:
    assert (on_measured_delay(dry_run(configuration(*overrides)))(round_trip) is not None) is is_said


# --- a rate that the machine can hardly hold, and addresses that nobody has


@pytest.mark.parametrize(("tick_us", "warns"), [(None, False), (1.0, False), (40.0, True), (500.0, True)])
def test_a_rate_beyond_the_machine_names_one_that_it_holds(tick_us: float | None, warns: bool) -> None:
    def cost(_: object) -> float | None:
        return None if tick_us is None else 1e-6 * tick_us

    lines = list(tick_rate(DryRun(configuration("rate_hz=10000")), cost))
    assert len(lines) == warns
    for line in lines:
        most = float(line.rpartition(" ")[2])
        assert most == pytest.approx(1e6 * TICK_SHARE / tick_us, abs=100.0)
        assert list(tick_rate(DryRun(configuration(f"rate_hz={most}")), cost)) == []
    assert list(tick_rate(DryRun(configuration(f"rate_hz={USUAL_RATE_HZ}")), pytest.fail)) == [], "it is not measured"


@pytest.mark.parametrize("file", ["loopback.yaml", "phantom.yaml"])
def test_a_tick_is_measured_with_stand_ins_for_hardware(file: str, tmp_path: Path) -> None:
    key = tmp_path / "key"
    generate(key)
    took = measured_tick_s(load(CONFIGS / file, ["rate_hz=10000", f"link.key_file={key}"]))
    assert took is not None and 2e-6 < took < 0.05


DEVICE = 'master.device={driver: polhem_serial, port: "ws://PLACE"}'


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("link.slave=192.0.2.1:47000", "link.slave 192.0.2.1:47000"),
        ('link.slave="[2001:db8::1]:47000"', "link.slave [2001:db8::1]:47000"),
        ("link.slave=10.0.0.2:47000", ""),
        ('link.slave="[2001:db9::1]:47000"', ""),
        (DEVICE.replace("PLACE", "192.0.2.1:10001#A7"), "master.device.port ws://192.0.2.1:10001#A7"),
        (DEVICE.replace("PLACE", "localhost:10001"), ""),
    ],
)
def test_an_address_that_nobody_has_is_named(override: str, told: str) -> None:
    given = [override, "link.slave=10.0.0.2:47000"] if "device" in override else [override]
    loaded = load(CONFIGS / "lan.yaml", given)
    assert [line.partition(": ")[0] for line in placeholders(DryRun(loaded))] == ([told] if told else [])
    slave = load(CONFIGS / "lan.yaml", given, sides=[SLAVE])
    assert not any("link.slave" in line for line in placeholders(DryRun(slave))), "the robot's host calls nobody"


# --- the coupling


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
    loaded = configuration(*overrides, "codec.position.step_m=4e-6")
    assert coupling(loaded) == build_robot(loaded).spec.stiffness_n_m == pytest.approx(expected)


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
