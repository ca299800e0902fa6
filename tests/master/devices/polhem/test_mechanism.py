"""Kinematics, force map, limits, weight and options of every published mechanism, and the page that lists them."""

from dataclasses import replace
from itertools import product
from math import cos, hypot, isfinite, pi, radians, sin
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml
from hypothesis import given, strategies as st

from tests.examples import examples
from weberlink.geometry.rotation import Quaternion, turned
from weberlink.geometry.vector import Vector, distance, dot, norm, scale
from weberlink.master.devices import DEVICES
from weberlink.master.devices.polhem.mechanism import GRAVITY_M_S2, Board, Counts, Mechanism, Wiring
from weberlink.master.devices.polhem.parameters import PARAMETERS, PolhemHidOptions

every_set = pytest.mark.parametrize("parameters", PARAMETERS.values(), ids=PARAMETERS)
ORIGIN: Vector = (0.0, 0.0, 0.0)
WOODY = PARAMETERS["woodenhaptics_2015"]
MIDDLE = WOODY.counts_at(ORIGIN)


def positions(parameters: Mechanism, count: int = 20) -> list[Vector]:
    """Random ones within three quarters of the published radius, which all of the mechanisms reach but for corners."""
    random, found = Random(7), list[Vector]()
    linkage, edge = parameters.linkage, 0.75 * parameters.radius_m
    while len(found) < count:
        x, y, z = (edge * random.uniform(-1.0, 1.0) for _ in range(3))
        if hypot(x, y, z) <= edge and distance(linkage.position(linkage.inverse((x, y, z))), (x, y, z)) < 1e-9:
            found.append((x, y, z))
    return found


def stepped(values: tuple[float, float, float], place: int, step: float) -> tuple[float, float, float]:
    a, b, c = (value + step * (number == place) for number, value in enumerate(values))
    return (a, b, c)


@every_set
def test_inverse_undoes_position_and_the_jacobian_is_its_derivative(parameters: Mechanism) -> None:
    linkage, step = parameters.linkage, 1e-5
    for position in positions(parameters):
        angles = linkage.inverse(position)
        assert distance(linkage.position(angles), position) < 1e-12
        rows = linkage.jacobian(angles)
        largest = max(abs(entry) for row in rows for entry in row)
        for body, axis in product(range(3), range(3)):
            ahead, behind = (linkage.position(stepped(angles, body, way))[axis] for way in (step, -step))
            assert abs(rows[axis][body] - (ahead - behind) / (2.0 * step)) < 1e-6 * largest


@every_set
def test_virtual_work_agrees_at_hand_and_motors(parameters: Mechanism) -> None:
    """F.dx = tau.dtheta, with the torque taken from the currents and the angle from the counts."""
    wiring = parameters.wiring
    mechanism, random = replace(parameters, wiring=replace(wiring, motor=wiring.encoder)), Random(3)
    for position in positions(parameters):
        counts = mechanism.counts_at(position)
        force = (random.uniform(-5, 5), random.uniform(-5, 5), random.uniform(-5, 5))
        currents = mechanism.currents_ma(force, counts)
        assert distance(mechanism.force(currents, counts), force) < 1e-9
        for motor in range(3):
            before, after = (mechanism.position(stepped(counts, motor, step)) for step in (-1, 1))  # type: ignore[arg-type]
            way = (after[0] - before[0], after[1] - before[1], after[2] - before[2])
            angle = 2.0 * 2.0 * pi / mechanism.counts_per_turn[motor]
            at_motor = currents[motor] * 1e-3 * mechanism.torque_constant_n_m_a[motor] * angle
            assert at_motor == pytest.approx(dot(force, way), abs=2e-9)


@every_set
def test_every_pose_is_finite_and_bounded(parameters: Mechanism) -> None:
    """Singular ones, those in which the links would not meet, and the nearest to what is out of reach."""
    linkage = parameters.linkage
    turns = [0.25 * pi * eighth for eighth in range(-4, 5)]
    for angles in product((0.0, 1.0), turns, turns):
        assert all(map(isfinite, linkage.position(angles)))
        counts = parameters.counts(angles)
        assert max(map(abs, parameters.currents_ma((1.0, 1.0, 1.0), counts))) < 1e6
        assert all(map(isfinite, parameters.force((1000.0, 1000.0, 1000.0), counts)))
    x, y, z = linkage.origin  # type: ignore[attr-defined]
    for far in ((10.0, 0.0, 0.0), (0.0, -10.0, 10.0), (0.0, 0.0, -10.0), (-x, -y, -z)):
        assert norm(linkage.position(linkage.inverse(far))) < 1.0


def test_woodenhaptics_as_published() -> None:
    assert WOODY.angles((0, 0, 0)) == pytest.approx((0.0, 0.0, pi / 2))
    home = WOODY.position((0, 0, 0))
    assert home == pytest.approx((0.025, 0.0, 0.205))
    per_count = [abs(each) for each in WOODY.radians_per_count]
    assert per_count == pytest.approx([1.96e-4, 2.62e-4, 2.62e-4], rel=2e-3)
    axes = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    assert all(33e-6 < distance(WOODY.position(counts), home) < 76e-6 for counts in axes)
    assert all(300 <= max(map(abs, WOODY.currents_ma(force, MIDDLE))) <= 900 for force in axes)


@pytest.mark.parametrize(
    ("t2", "t3", "forearm", "by_2", "by_3"),
    [
        (50, 160, -0.5181152, 0.1725403, 0.0224038),
        (80, 130, -1.3313918, 0.0280152, 0.0071584),
        (80, 190, -0.4424160, 0.0200333, 0.0223360),
        (110, 205, -0.7320160, -0.1693901, 0.0345671),
    ],
)
def test_five_bar_and_its_weight_are_those_of_the_makers(
    t2: float, t3: float, forearm: float, by_2: float, by_3: float
) -> None:
    """As hfab_polhem.h computes them: the angle of the forearm, and the derivative of the energy of the links."""
    mechanism, angles = PARAMETERS["polhem_v3"], (0.0, radians(t2), radians(t3))
    assert mechanism.linkage.forearm(angles) == pytest.approx(forearm, abs=1e-7)
    assert mechanism.linkage.weight(angles) == pytest.approx((0.0, by_2, by_3), abs=1e-6)


@pytest.mark.parametrize(("b", "c"), [(0.0, 1.6), (0.4, 1.2), (-0.2, 2.0)])
def test_parallelogram_weight_is_derivative_of_energy(b: float, c: float) -> None:
    def energy(b: float, c: float) -> float:
        return GRAVITY_M_S2 * (0.170 * 0.051 * cos(b) + 0.110 * (0.205 * cos(b) - 0.091 * cos(c)))

    step = 1e-5
    by_b = (energy(b + step, c) - energy(b - step, c)) / (2.0 * step)
    by_c = (energy(b, c + step) - energy(b, c - step)) / (2.0 * step)
    assert WOODY.linkage.weight((0.3, b, c)) == pytest.approx((0.0, by_b, by_c), abs=1e-8)


@pytest.mark.parametrize("name", ["polhem_v1", "polhem_v3", "vintage_phantom"])
def test_straight_gimbal_points_along_the_forearm(name: str) -> None:
    mechanism = PARAMETERS[name]
    for position in positions(PARAMETERS[name]):
        counts = mechanism.counts_at(position)
        home = mechanism.wiring.gimbal_home_counts
        orientation = mechanism.orientation((*counts, *(-count for count in home)))
        assert orientation is not None
        angles = mechanism.angles(counts)
        lam = mechanism.linkage.forearm(angles)
        ahead = (cos(angles[0]) * cos(lam), sin(angles[0]) * cos(lam), sin(lam))
        assert turned(orientation, (1.0, 0.0, 0.0)) == pytest.approx(ahead, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "board", "gimbal", "orientation"),
    [
        ("polhem_v3", "serial", (100, 0, 0), (0.8690, -0.2753, 0.3920, 0.1242)),
        ("polhem_v3", "serial", (0, 100, 0), (0.9932, 0.0, 0.1167, 0.0)),
        ("polhem_v3", "serial", (0, 0, 100), (0.8690, 0.2753, 0.3920, -0.1242)),
        ("polhem_v3", "hid14", (0, 0, 100), (0.8690, -0.2753, 0.3920, 0.1242)),  # by the API of 2021, the other way
        ("vintage_phantom", "serial", (100, 0, 0), (0.7010, -0.1102, 0.6958, -0.1110)),
        ("vintage_phantom", "serial", (0, 100, 0), (0.5908, 0.0, 0.8069, 0.0)),
        ("vintage_phantom", "serial", (0, 0, 100), (0.7010, 0.1110, 0.6958, -0.1102)),
    ],
)
def test_each_gimbal_axis_turns_the_handle(
    name: str, board: Board, gimbal: tuple[int, ...], orientation: Quaternion
) -> None:
    """In the middle of the workspace, from the straight gimbal on."""
    parameters = PARAMETERS[name]
    mechanism = replace(parameters, wiring=parameters.wirings[board])
    home = mechanism.wiring.gimbal_home_counts
    found = mechanism.orientation((*mechanism.counts_at(ORIGIN), *(a - b for a, b in zip(gimbal, home, strict=True))))
    assert found == pytest.approx(orientation, abs=1e-4)


@examples(60)
@given(
    st.sampled_from(sorted(PARAMETERS)),
    st.tuples(*[st.floats(-1e6, 1e6)] * 3),
    st.tuples(*[st.integers(-40_000, 40_000)] * 3),
)
def test_current_limit_holds_everywhere(name: str, force: Vector, counts: Counts) -> None:
    currents = PARAMETERS[name].limited_currents_ma(force, counts, 5.0, 1500.0)
    assert all(isfinite(current) and abs(current) <= 1500 for current in currents)


@pytest.mark.parametrize(("force_n", "current_ma", "felt_n"), [(2.0, 6e3, 2.0), (100.0, 800.0, 1.43), (6.0, 6e3, 4.58)])
def test_limited_force_keeps_its_direction(force_n: float, current_ma: float, felt_n: float) -> None:
    asked = (1.0, -2.0, 4.0)
    currents = WOODY.limited_currents_ma(asked, MIDDLE, force_n, current_ma)
    felt = WOODY.force(currents, MIDDLE)
    assert distance(felt, scale(asked, norm(felt) / norm(asked))) < 0.02
    assert norm(felt) == pytest.approx(felt_n, abs=0.02)
    assert max(map(abs, currents)) <= current_ma


# --- what is published, and what options change of it


@every_set
def test_limits_are_plausible_and_every_board_has_the_same_home_pose(parameters: Mechanism) -> None:
    assert parameters.force_n <= 5.0
    assert 500.0 <= parameters.stiffness_n_m <= 2000.0
    assert 0.1 <= parameters.radius_m <= 0.15
    # Other signs come with other home counts: where a sign of one is wrong, the pose is another.
    for wiring in parameters.wirings.values():
        pose = replace(parameters, wiring=wiring).angles((0, 0, 0))
        assert pose == pytest.approx(parameters.angles((0, 0, 0)), abs=1e-9)


@pytest.mark.parametrize(
    ("name", "reach_m"),
    [("woodenhaptics_2015", 0.255), ("vintage_phantom", 0.2), ("polhem_v1", 0.2), ("polhem_v3", 0.3)],
)
def test_the_workspace_holds_the_home_pose_and_twice_the_radius(name: str, reach_m: float) -> None:
    assert PARAMETERS[name].reach_m == pytest.approx(reach_m)


def wiring_of(**settings: Any) -> Wiring:
    return PolhemHidOptions(parameters="polhem_v3", **settings).wired().wiring


@pytest.mark.parametrize(
    ("option", "field", "value"),
    [
        ("encoder_directions", "encoder", (-1, 1, -1)),
        ("motor_directions", "motor", (-1, 1, -1)),
        ("gimbal_directions", "gimbal", (-1, 1, -1)),
        ("home_counts", "home_counts", (1, 2, 3)),
    ],
)
def test_an_option_replaces_the_signs_or_counts_that_it_names(option: str, field: str, value: Any) -> None:
    assert wiring_of(**{option: value}) == replace(wiring_of(), **{field: value}) != wiring_of()


PAGE = (Path(__file__).parents[4] / "docs" / "devices" / "polhem.md").read_text()
EXAMPLES = [block.split("```")[0] for block in PAGE.split("```yaml\n")[1:]]


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_are_options_of_their_driver(example: str) -> None:
    settings: dict[str, Any] = yaml.safe_load(example)["master"]["device"]
    driver: Any = DEVICES.load(settings.pop("driver"))
    assert driver(driver.Options(**settings), 0.001).spec.name
