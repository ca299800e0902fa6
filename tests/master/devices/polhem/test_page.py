"""What the page about these devices says, against what they do."""

from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml

from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.master.devices import load
from weberlink.master.devices.polhem.parameters import MODEL_SETS, PARAMETERS, Board

PAGE = (Path(__file__).parents[4] / "docs" / "devices" / "polhem.md").read_text()
EXAMPLES = [block.split("```")[0] for block in PAGE.split("```yaml\n")[1:]]
CELLS = [[cell.strip() for cell in line.split("|")[1:-1]] for line in PAGE.splitlines()]
ROWS = {cells[0].strip("`"): cells[1:] for cells in CELLS if len(cells) == 6 and cells[0].startswith("`")}
SIGNS = {(cells[0].strip("`"), cells[1]): cells[2:] for cells in CELLS if len(cells) == 7 and cells[0].startswith("`")}
BOARDS: dict[str, Board] = {"serial": "serial", "HID, 14 bytes": "hid14", "HID, 8 bytes": "hid8"}
AXES: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_are_options_of_their_driver(example: str) -> None:
    settings: dict[str, Any] = yaml.safe_load(example)["master"]["device"]
    driver: Any = load(settings.pop("driver"))
    assert driver(driver.Options(**settings), 0.001).spec.name


def test_there_are_two_examples_and_a_row_for_every_set() -> None:
    assert len(EXAMPLES) == 2
    assert list(ROWS) == list(PARAMETERS)


@pytest.mark.parametrize("name", ROWS)
def test_a_row_is_what_the_set_computes(name: str) -> None:
    use, home, steps, currents, force = ROWS[name]
    parameters = PARAMETERS[name]
    mechanism = parameters.mechanism
    for number, of_model in MODEL_SETS.items():
        assert (f"model {number}" in use) == (of_model == name)
    assert home == in_row([round(component * 1e3) for component in mechanism.position((0, 0, 0))])
    middle = mechanism.counts_at(ZERO)
    here = mechanism.position(middle)
    moved = [[count + (i == motor) for i, count in enumerate(middle)] for motor in range(3)]
    assert steps == in_row([round(distance(mechanism.position(counts), here) * 1e6) for counts in moved])
    assert currents == in_row([round(max(map(abs, mechanism.currents_ma(axis, middle)))) for axis in AXES])
    assert float(force) == pytest.approx(weakest(name), rel=0.05)


def test_the_signs_are_those_of_the_drivers() -> None:
    known = {(name, board) for name, each in PARAMETERS.items() for board in each.wirings}
    assert {(name, BOARDS[board]) for name, board in SIGNS} == known
    for (name, board), (encoders, motors, home_counts, gimbal, source) in SIGNS.items():
        wiring = PARAMETERS[name].wirings[BOARDS[board]]
        assert encoders == signs(wiring.encoder)
        assert motors == signs(wiring.motor)
        assert home_counts == in_row(wiring.home_counts)
        has_gimbal = 0 not in PARAMETERS[name].mechanism.drive.gimbal_counts_per_turn
        assert gimbal == (signs(wiring.gimbal) if has_gimbal else "")
        assert source.split()[0] in wiring.source


def signs(three: tuple[int, int, int]) -> str:
    return " ".join("+-"[sign < 0] for sign in three)


def in_row(numbers: Any) -> str:
    return ", ".join(map(str, numbers))


def weakest(name: str) -> float:
    """Force in the direction in which 2 A give least [N]."""
    mechanism, random = PARAMETERS[name].mechanism, Random(0)
    middle = mechanism.counts_at(ZERO)
    least = float("inf")
    for _ in range(1000):
        way = (random.gauss(), random.gauss(), random.gauss())
        least = min(least, 2000.0 * norm(way) / max(map(abs, mechanism.currents_ma(way, middle))))
    return least
