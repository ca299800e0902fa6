"""Published parameter sets, the options that change them, and the page that lists them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from weberlink.master.devices import DEVICES
from weberlink.master.devices.polhem.mechanism import Mechanism, Wiring
from weberlink.master.devices.polhem.parameters import PARAMETERS, PolhemHidOptions

every_set = pytest.mark.parametrize("parameters", PARAMETERS.values(), ids=PARAMETERS)


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
