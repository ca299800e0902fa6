"""Errors are scored in the measure of the session's own deadband, also after a live change of its Weber factor."""

from typing import Any

import numpy as np
import pytest

from tests.session.systems import configuration, steps
from weberlink.config import Configuration
from weberlink.control.tuning import LiveSettings
from weberlink.figures.channel import in_session
from weberlink.figures.session import Records, score_of
from weberlink.session.composition.channels import force_deadband, measures_in
from weberlink.session.simulation import as_array, build_simulation

WEBERS = (0.25, 0.05)
SHAPES = ("cone", "level_crossing")


def session(shape: str) -> tuple[Configuration, Records, Records]:
    """The records of both sides of a session in which k falls to a fifth: within its deadband but for delays."""
    loaded = configuration(
        f"codec.force.deadband={{shape: {shape}}}", f"codec.force.weber={WEBERS[0]}", "codec.force.predictor=zoh",
        "slave.scene=[{shape: sphere, radius_m: 0.1, center_m: [0, 0, -0.1], stiffness_n_m: 500}]",
    )  # fmt: skip
    simulation = build_simulation(loaded)
    seen = list(steps(simulation, 1.5))
    assert simulation.master.propose({"weber": WEBERS[1]}, 1.5) is None
    seen += steps(simulation, 1.5)
    assert simulation.slave.tuning.settings == LiveSettings(WEBERS[1], "zoh")
    return loaded, as_array([step.master for step in seen]), as_array([step.slave for step in seen])


def error(loaded: Configuration, slave: Any, displayed: Any, weber: float | None = None) -> float:
    """Of a displayed force [N], in the measure of the deadband at the tick of a record."""
    deadband = force_deadband(loaded.system, float(slave["weber"]) if weber is None else weber)
    return deadband.error(tuple(displayed.tolist()), tuple(slave["raw"].tolist()))


@pytest.fixture(scope="module", params=SHAPES)
def scored(request: pytest.FixtureRequest) -> tuple[Configuration, Records, Records, dict]:
    """With the figures of the launcher."""
    loaded, master, slave = session(request.param)
    score = score_of(loaded.system)
    score.add(master, slave)
    return loaded, master, slave, score.figures().to_json()["force"]


def test_what_the_peer_holds_is_within_the_deadband_of_its_shape_and_factor(scored) -> None:
    loaded, _, slave, figures = scored
    assert figures["coding"]["violation_fraction"] == 0.0
    counted = slave[in_session(slave)]
    assert set(counted["weber"]) == set(WEBERS)
    assert all(error(loaded, one, one["decoded"]) <= one["bound"] for one in counted)
    assert (np.linalg.norm(counted["decoded"] - counted["raw"], axis=1) > counted["bound"]).any(), "a ball would not do"
    assert any(error(loaded, one, one["decoded"], WEBERS[0]) > one["bound"] for one in counted), "nor the file's k"


def test_a_recording_of_an_unknown_deadband_is_refused() -> None:
    dump = configuration().system.model_dump(mode="json")
    dump["codec"]["force"]["deadband"] = {"shape": "wedge"}
    with pytest.raises(ValueError, match="wedge"):
        measures_in(dump)
    with pytest.raises(ValueError, match="deadband"):
        measures_in({})
