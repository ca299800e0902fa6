"""What a file asks beyond device, robot and rate: said before a run with advice that ends the warning; and coupling."""

import json
from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from tests.session.systems import CONFIGS, configuration
from weberlink.cli.check import describe
from weberlink.session.advice import advise, dry_run
from weberlink.session.composition.coupling import FIT_MARGIN, coupling, press_limit
from weberlink.session.composition.slave import build_robot
from weberlink.slave.robots.virtual import STIFFEST

DISPLAYED = 3000.0
"""Stiffness that its device displays [N/m]."""


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


UNITS = (
    "_kg", "_kg_m2", "_n", "_nm", "_n_m", "_n_m_rad", "_n_s", "_n_s_m", "_nm_s", "_n_m_s_rad", "_hz", "_m_s", "_rad_s",
    "_j",
)  # fmt: skip


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
