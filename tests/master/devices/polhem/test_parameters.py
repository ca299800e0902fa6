"""What the sets say of themselves, and what the drivers ask of them."""

from dataclasses import replace
from typing import Any, get_args

import pytest
from pydantic import ValidationError

from weberlink.master.devices.polhem.bracket import MODELS
from weberlink.master.devices.polhem.drive import Drive
from weberlink.master.devices.polhem.options import Model, PolhemHidOptions, SetName
from weberlink.master.devices.polhem.parameters import MODEL_SETS, PARAMETERS, Parameters

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


@every_set
def test_every_board_has_the_same_home_pose(parameters: Parameters) -> None:
    """Other signs come with other home counts: where a sign of one is wrong, the pose is another."""
    poses = [parameters.on(board).mechanism.drive.angles((0, 0, 0)) for board in parameters.wirings]
    for pose in poses:
        assert pose == pytest.approx(poses[0], abs=1e-9)
    assert parameters.mechanism.drive.angles((0, 0, 0)) == poses[0]


def drive_of(**settings: Any) -> Drive:
    return PolhemHidOptions(parameters="polhem_v3", **settings).wired().mechanism.drive


def test_signs_and_home_counts_are_replaced_one_by_one() -> None:
    published = drive_of()
    assert drive_of(encoder_directions=(-1, 1, 1)) == replace(published, encoder_directions=(-1, 1, 1))
    assert drive_of(motor_directions=(-1, 1, 1)) == replace(published, motor_directions=(-1, 1, 1))
    assert drive_of(home_counts=(1, 2, 3)) == replace(published, home_counts=(1, 2, 3))
    assert drive_of(gimbal_directions=(1, 1, 1)) == replace(published, gimbal_directions=(1, 1, 1))


def test_the_old_key_is_both_where_the_published_signs_are_alike() -> None:
    both = replace(drive_of(), encoder_directions=(-1, 1, 1), motor_directions=(-1, 1, 1))
    assert drive_of(directions=(-1, 1, 1)) == both


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        (
            {"report_bytes": 8, "directions": (1, 1, 1)},
            r"directions: .*\[-1, -1, -1\] and \[1, -1, -1\]; set",
        ),
        ({"directions": (1, 1, 1), "motor_directions": (1, 1, 1)}, "directions: leave it out beside"),
        ({"parameters": "aluhaptics_v2"}, "published for 8-byte reports, not for 14-byte reports: set encoder_dir"),
        ({"parameters": "aluhaptics_v2", "encoder_directions": (1, 1, 1)}, "published for 8-byte reports"),
        ({"parameters": "vintage_phantom", "directions": (1, 1, 1)}, "published for the serial board"),
        ({"parameters": "vintage_phantom_2021", "gravity_compensation": True}, "no masses are published"),
    ],
)
def test_signs_that_nobody_knows_are_asked_for(settings: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        PolhemHidOptions(**settings)


def test_signs_that_are_not_published_may_be_given() -> None:
    given = PolhemHidOptions(
        parameters="aluhaptics_v2", encoder_directions=(-1, 1, -1), motor_directions=(1, 1, 1), home_counts=(0, 3878, 0)
    )
    drive = given.wired().mechanism.drive
    assert (drive.encoder_directions, drive.motor_directions) == ((-1, 1, -1), (1, 1, 1))
    assert drive.angles((0, 0, 0)) == PARAMETERS["aluhaptics_v2"].mechanism.drive.angles((0, 0, 0))
