"""What the sets say of themselves, and what the drivers ask of them."""

from typing import get_args

import pytest

from master.devices.polhem.bracket import MODELS
from master.devices.polhem.options import Model, SetName
from master.devices.polhem.parameters import MODEL_SETS, PARAMETERS, Parameters

every_set = pytest.mark.parametrize("parameters", PARAMETERS.values(), ids=PARAMETERS)


def test_the_options_name_the_sets_and_the_models_there_are() -> None:
    assert set(get_args(SetName)) == set(PARAMETERS)
    assert set(get_args(Model)) == set(MODELS.values())
    assert set(MODEL_SETS) == set(MODELS)
    assert set(MODEL_SETS.values()) <= set(PARAMETERS)


@every_set
def test_a_set_says_where_it_was_read_and_stays_modest(parameters: Parameters) -> None:
    assert parameters.source
    assert parameters.force_n <= 5.0
    assert 500.0 <= parameters.stiffness_n_m <= 2000.0
    assert 0.1 <= parameters.radius_m <= 0.15
    # The wire of the default configuration spans 0.327 m.
    assert parameters.radius_m < parameters.reach_m < 0.32


def test_home_counts_by_model_as_published() -> None:
    homes = {model: PARAMETERS[name].mechanism.drive.home_counts for model, name in MODEL_SETS.items()}
    assert homes == {1: (8312, -10366, 19764), 2: (0, 7700, 0), 3: (0, 0, -6000)}


def test_hid_boards_of_woodenhaptics_count_the_other_way_on_a() -> None:
    parameters = PARAMETERS["woodenhaptics_2015"]
    assert parameters.mechanism.drive.directions == (1, -1, -1)
    assert parameters.over_hid().mechanism.drive.directions == (-1, -1, -1)
    assert PARAMETERS["polhem_v3"].over_hid() is PARAMETERS["polhem_v3"]


def test_directions_and_home_counts_are_replaced_one_by_one() -> None:
    parameters = PARAMETERS["polhem_v3"]
    drive = parameters.turned((1, 1, 1), None).mechanism.drive
    assert (drive.directions, drive.home_counts) == ((1, 1, 1), parameters.mechanism.drive.home_counts)
    drive = parameters.turned(None, (1, 2, 3)).mechanism.drive
    assert (drive.directions, drive.home_counts) == (parameters.mechanism.drive.directions, (1, 2, 3))
