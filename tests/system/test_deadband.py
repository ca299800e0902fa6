"""The shape of the force's deadband: from the file to both sides, through a live change, and in a study."""

import json
from collections.abc import Sequence
from math import pi, radians
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.system.systems import configuration, decoded, raw, steps, system
from weberlink.cli import app
from weberlink.codec import Encoder
from weberlink.codec.deadband import (
    DEADBANDS,
    ConeDeadband,
    Deadband,
    ForceDeadband,
    LevelCrossingDeadband,
    VelocityDeadband,
)
from weberlink.geometry.vector import distance, norm
from weberlink.protocol.states import State
from weberlink.system.composition.channels import channels, measures_of
from weberlink.system.composition.link import agreement
from weberlink.system.configuration import Configuration, ConfigurationError, load
from weberlink.system.simulate import build_simulation

ROOT = Path(__file__).parents[2]
OPERATOR = ROOT / "configs" / "traces" / "operator.npz"
LINK = "link: {security: none, listen: '127.0.0.1:0', slave: '127.0.0.1:0'}\n"


def configured(folder: Path, force: str, *overrides: str) -> Configuration:
    path = folder / "system.yaml"
    path.write_text(f"{LINK}codec:\n  force: {force}\n")
    return load(path, overrides)


@pytest.mark.parametrize(("force", "expected"), [
    ("{}", ForceDeadband(0.1, 0.02)),
    ("{deadband: {shape: isotropic}, reference: sent}", ForceDeadband(0.1, 0.02, "sent")),
    ("{deadband: {shape: cone}}", ConeDeadband(0.1, 0.02, radians(18.4))),
    ("{deadband: {shape: cone, direction_deg: 180}, floor_n: 0}", ConeDeadband(0.1, 0.0, pi)),
    ("{deadband: {shape: level_crossing, hysteresis: 0.5}, weber: 0.2}",
     LevelCrossingDeadband(0.2, 0.02, radians(18.4), 0.5)),
    ("{deadband: {shape: velocity_adaptive, slope_s_m: 2, most_weber: 0.3}, reference: displayed}",
     VelocityDeadband(0.1, 0.02, "displayed", 2.0, 0.3, 2e-3)),
])  # fmt: skip
def test_a_file_says_the_shape(tmp_path: Path, force: str, expected: Deadband) -> None:
    loaded = configured(tmp_path, force, "rate_hz=500")
    _, backward = channels(loaded.system)
    assert backward.deadband == expected


def test_both_ends_must_have_the_same_shape(tmp_path: Path) -> None:
    said = [
        agreement(configured(tmp_path, force).system)
        for force in ("{}", "{deadband: {shape: cone}}", "{deadband: {shape: cone, direction_deg: 30}}")
    ]
    assert said[0]["codec.force.deadband.shape"] == "isotropic"
    assert said[0] != said[1] != said[2]


@pytest.mark.parametrize(("force", "expected"), [
    ("{deadband: {shape: wedge}}", "codec.force.deadband"),
    ("{deadband: {shape: cone, hysteresis: 0.1}}", "hysteresis"),
    ("{deadband: {shape: cone, direction_deg: 0}}", "direction_deg"),
    ("{deadband: {shape: cone}, reference: sent}", "needs reference: actual"),
    ("{deadband: {shape: level_crossing}, reference: displayed}", "needs reference: actual"),
    ("{deadband: {shape: level_crossing}, floor_n: 0}", "needs floor_n above 0"),
    ("{deadband: {shape: level_crossing, hysteresis: 1.5}}", "hysteresis"),
    ("{deadband: {shape: velocity_adaptive, slope_s_m: -1}}", "slope_s_m"),
])  # fmt: skip
def test_what_is_no_shape_is_one_line(tmp_path: Path, force: str, expected: str) -> None:
    with pytest.raises(ConfigurationError, match=expected) as refused:
        configured(tmp_path, force)
    assert "\n" not in str(refused.value)


def example() -> str:
    """The configuration that the documentation shows."""
    text = (ROOT / "docs" / "deadbands.md").read_text()
    return text.split("```yaml\n", 1)[1].split("```", 1)[0]


def test_the_example_of_the_documentation_is_complete_and_runs(tmp_path: Path) -> None:
    path = tmp_path / "example.yaml"
    path.write_text(example())
    checked = CliRunner().invoke(app, ["check", str(path)])
    assert checked.exit_code == 0, checked.output
    assert "cone of 25.6 deg" in checked.output
    ran = CliRunner().invoke(app, ["simulate", str(path), "--duration", "3"])
    assert ran.exit_code == 0, ran.output


@pytest.mark.parametrize("shape", DEADBANDS)
def test_a_session_keeps_the_law_of_its_shape(shape: str) -> None:
    loaded = configuration(
        f"codec.force.deadband={{shape: {shape}}}",
        "codec.force.predictor=zoh",
        "slave.scene=[{shape: plane, stiffness_n_m: 500}]",
    )
    measures = measures_of(loaded.system)
    error = distance if measures is None else measures(loaded.system.codec.force.weber)
    held = sent = 0
    for step in steps(build_simulation(loaded), 2.0):
        if step.slave.state != State.ENGAGED.value or step.slave.ramping:
            continue
        sent += step.slave.sent
        if not step.slave.sent:
            assert error(decoded(step.slave), raw(step.slave)) <= step.slave.bound
            held += norm(raw(step.slave)) > 0.0
    assert sent > 0
    assert held > 100


def test_a_live_change_of_the_weber_factor_keeps_the_shape(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Deadband] = []
    retune = Encoder.retune

    def noted(self: Encoder, deadband: Deadband, selectors: Sequence[int]) -> None:
        given.append(deadband)
        retune(self, deadband, selectors)

    monkeypatch.setattr(Encoder, "retune", noted)
    simulation = system(
        "codec.force.deadband={shape: cone, direction_deg: 40}", "slave.scene=[{shape: plane, stiffness_n_m: 500}]"
    )
    list(steps(simulation, 0.5))
    assert simulation.master.propose({"weber": 0.3}, 0.5) is None
    list(steps(simulation, 1.0))
    assert given == [ConeDeadband(0.3, 0.02, radians(40.0))]


# A study.


def rows(*arguments: str) -> list[dict[str, object]]:
    result = CliRunner().invoke(app, ["study", "evaluate", str(OPERATOR), *arguments, "--json", "-"])
    assert result.exit_code == 0, result.output
    found: list[dict[str, object]] = json.loads(result.stdout)["rows"]
    return found


def test_a_study_has_a_row_for_every_shape() -> None:
    found = rows("--predictor", "zoh,plane", "--weber", "0.1", "--deadband", "isotropic,cone,velocity_adaptive")
    expected = [
        (shape, predictor, weber)
        for shape in ("isotropic", "cone", "velocity_adaptive")
        for predictor in ("zoh", "plane")
        for weber in (0.1,)
    ]
    assert [(row["deadband"], row["predictor"], row["weber"]) for row in found] == expected
    assert all(row["violation_fraction"] == 0.0 for row in found)
    alone = rows("--predictor", "zoh,plane", "--weber", "0.1")
    assert [row["packets"] for row in alone] == [row["packets"] for row in found[:2]]
    assert {row["deadband"] for row in alone} == {"isotropic"}


@pytest.mark.parametrize(("arguments", "expected"), [
    (("--deadband", "wedge"), "--deadband: 'wedge' is none of isotropic, cone, level_crossing, velocity_adaptive"),
    (("--deadband", "cone,cone"), "--deadband: cone is listed twice"),
    (("--deadband", "level_crossing", "--floor", "0"), "--floor above 0"),
])  # fmt: skip
def test_a_shape_that_cannot_be_studied_is_one_line(arguments: tuple[str, ...], expected: str) -> None:
    result = CliRunner().invoke(app, ["study", "evaluate", str(OPERATOR), *arguments])
    assert result.exit_code == 2
    assert expected in " ".join(result.output.split())
