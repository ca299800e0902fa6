"""A plugin that lacks a part of its contract is one line at `check`, whatever it is; never a traceback in a session."""

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from tests.system.packages import install
from tests.system.systems import CONFIGS
from weberlink.cli import app
from weberlink.cli.program import installed

ENTRY_POINTS = """
[weberlink.devices]
mute = lacking:MuteDevice
plain = lacking:PlainDevice
[weberlink.robots]
numb = lacking:NumbRobot
[weberlink.predictors]
idle = lacking:IDLE
[weberlink.deadbands]
boundless = lacking:Boundless
[weberlink.integrators]
stuck = lacking:STUCK
[weberlink.shapes]
fog = lacking:Fog
"""
LACKING = """
from typing import Literal

from pydantic import BaseModel

from weberlink.codec.deadband import Deadband
from weberlink.codec.predictors import Predictor
from weberlink.master.devices.operator import OperatorDevice
from weberlink.slave.integrators import IntegrationScheme
from weberlink.slave.robots.point import PointRobot
from weberlink.slave.scenes.shape import SceneShapeSettings


class MuteDevice:
    Options = OperatorDevice.Options

    def __init__(self, options, tick_period):
        self.spec = OperatorDevice(options, tick_period).spec

    def open(self, now): ...
    def latest(self, now): ...
    def close(self): ...


class PlainDevice:
    pass


class NumbRobot:
    Options = PointRobot.Options

    def __init__(self, options, scene, tick_period):
        self.spec = PointRobot(options, scene, tick_period).spec

    def open(self, now): ...
    def command(self, position, now): ...
    def close(self): ...


class Idle(Predictor):
    name = "idle"


class Boundless(Deadband):
    name = "boundless"
    summary = "No bound."

    def error(self, displayed, actual): ...


class Nothing:
    def __init__(self, *_): ...


IDLE = Idle()
STUCK = IntegrationScheme("lacking:Nothing", 1, l_stable=False)


class Fog(SceneShapeSettings):
    shape: Literal["fog"]
"""
PSK = ("link.security=psk",)


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (("master.device.driver=mute", *PSK), "master.device: lacking:MuteDevice has no command; its contract is"),
        (("master.device.driver=plain", *PSK), "master.device.driver: plain has no Options"),
        (("slave.robot.driver=numb", *PSK), "slave.robot: lacking:NumbRobot has no latest; its contract is"),
        (("codec.force.predictor=idle",), "predictor idle: lacking:Idle does not override fit"),
        (("codec.force.deadband={shape: boundless}",), "lacking:Boundless does not override configured, bound"),
        (("slave.robot={driver: simulated, integrator: stuck}",), "lacking:Nothing has no advance"),
        (("slave.scene=[{shape: fog, stiffness_n_m: 100}]",), "shape fog: lacking:Fog does not override solid"),
    ],
)
def test_plugin_without_a_method_is_one_line(
    overrides: tuple[str, ...], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, "lacking", {"lacking": LACKING}, ENTRY_POINTS)
    monkeypatch.syspath_prepend(str(tmp_path))
    key = tmp_path / "key"
    assert CliRunner().invoke(app, ["keygen", str(key)]).exit_code == 0
    arguments = [part for each in (*overrides, f"link.key_file={key}") for part in ("--set", each)]
    result = CliRunner().invoke(app, ["check", str(CONFIGS / "loopback.yaml"), *arguments])
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    (line,) = result.stderr.splitlines()
    assert told in line


@pytest.mark.parametrize(("value", "told"), [("math:pi", "not a function"), ("no_such_module:run", "ModuleNotFound")])
def test_broken_command_says_why(value: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    command = installed(EntryPoint("broken", value, "weberlink.commands"))
    with pytest.raises(typer.Exit) as caught:
        command()
    assert caught.value.exit_code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line
