"""What a configuration file says of these predictors and deadbands."""

from math import radians
from typing import Any

import pytest

from tests.session.systems import CONFIGS, configuration
from weberlink.codec.deadband import Deadband
from weberlink.config import ConfigurationError, load
from weberlink.session.composition.channels import streams
from weberlink_predictors.adaptive import BANKS
from weberlink_predictors.cone import ConeDeadband
from weberlink_predictors.level_crossing import LevelCrossingDeadband
from weberlink_predictors.velocity import VelocityDeadband

DEADBANDS: dict[str, Deadband] = {
    "{deadband: {shape: cone}}": ConeDeadband(0.1, 0.02, radians(18.4)),
    "{deadband: {shape: level_crossing, hysteresis: 0.5}, weber: 0.2}": LevelCrossingDeadband(
        0.2, 0.02, radians(18.4), 0.5
    ),
    "{deadband: {shape: velocity_adaptive, slope_s_m: 2, most_weber: 0.3}, reference: displayed}": VelocityDeadband(
        0.1, 0.02, "displayed", 2.0, 0.3, 2e-3
    ),
}


@pytest.mark.parametrize("force", DEADBANDS)
def test_a_file_says_the_shape_of_the_deadband(force: str) -> None:
    loaded = configuration(f"codec.force={force}", "rate_hz=500")
    made, expected = streams(loaded.system)[1][0].deadband, DEADBANDS[force]
    assert type(made) is type(expected)
    for name in dir(expected):
        value = getattr(expected, name)
        assert name.startswith("__") or callable(value) or getattr(made, name) == value, name


@pytest.mark.parametrize(
    ("force", "said"),
    [
        ("{deadband: {shape: cone, slope_s_m: 1}}", "unknown key; known are direction_deg, shape"),
        ("{deadband: {shape: cone}, reference: sent}", "needs reference: actual"),
        ("{deadband: {shape: level_crossing}, floor_n: 0}", "needs floor_n above 0"),
        ("{deadband: {shape: cone}, smooth_ms: 5}", "needs a deadband that is a ball"),
        ("{bank: [zoh, surface]}", "hybrid does not make the models of surface"),
    ],
)
def test_what_does_not_go_together_is_refused_in_words(force: str, said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        load(CONFIGS / "loopback.yaml", [f"codec.force={force}"])


@pytest.mark.parametrize(("section", "signal"), [
    ("force", "force"), ("position", "position"), ("rotation.torque", "torque"), ("rotation.orientation", "position"),
])  # fmt: skip
def test_the_bank_of_adaptive_has_all_that_suit_the_signal(section: str, signal: str) -> None:
    loaded = configuration(f"codec.{section}.predictor=adaptive", file="rotation.yaml")
    found: Any = loaded.system.codec
    for name in section.split("."):
        found = getattr(found, name)
    assert found.bank == BANKS[signal]
