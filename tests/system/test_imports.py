"""Only what a file names is imported, built, computed and sent."""

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.system.systems import CONFIGS, configuration, output, raw, steps, system
from weberlink.cli import app
from weberlink.codec import Channel, Decoder, Encoder
from weberlink.codec.predictors import PREDICTORS, Model, Predictor, Trust
from weberlink.codec.sample import Sample
from weberlink.protocol.wire import UpdateLayout
from weberlink.slave.integrators import INTEGRATORS
from weberlink.system.composition.channels import channels
from weberlink.system.composition.slave import build_robot
from weberlink.system.configuration import load

FILES = sorted(path.name for path in CONFIGS.glob("*.yaml"))
SIDES = ("master", "slave")
Modules = dict[tuple[str, str], frozenset[str]]
Fit = Callable[[Sample, Sample | None, Trust], Model]

# What the process of a daemon imports and builds before its first tick.
BUILD = """
import json, os, sys
from pathlib import Path
import weberlink.system.daemon
from weberlink.system.composition.link import build_security
from weberlink.system.configuration import load
from weberlink.system.configuration.model import split_address

file, side, *overrides = sys.argv[1:]
configuration = load(Path(file), overrides, sides=[side])
common = {
    "security": build_security(configuration), "entropy": os.urandom, "epoch": 0.0, "stopwatch": lambda: 0.0,
}
if side == "master":
    from weberlink.system.composition.master import build_master
    build_master(configuration, peer=split_address(configuration.system.link.slave), **common)
else:
    from weberlink.system.composition.slave import build_slave
    build_slave(configuration, **common)
json.dump(sorted(sys.modules), sys.stdout)
"""

OBSERVERS = {"evaluation", "weberlink.cli", "weberlink.system.launcher", "weberlink.telemetry.reader"}
"""What only the command line, the offline evaluation and observers import."""

NEVER = OBSERVERS | {
    "scipy",
    "matplotlib",
    "pandas",
    "flask",
    "fastapi",
    "starlette",
    "aiohttp",
    "http.server",
    "typer",
    "click",
    "rich",
}
"""Not even one of their packages."""


ALL_HARDWARE = {"serial", "hid", "hidraw", "hardware", "weberlink.master.emulators", "weberlink.slave.emulators"}
"""Nothing of these where all is computed; a stand-in for hardware never."""


def imported(name: str, side: str, *overrides: str) -> frozenset[str]:
    """Modules of a process that has built one side of a shipped file."""
    ended = subprocess.run(
        [sys.executable, "-c", BUILD, str(CONFIGS / name), side, *overrides],
        cwd=CONFIGS.parent,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    return frozenset(json.loads(ended.stdout))


@pytest.fixture(scope="module")
def key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("imports") / "weberlink.key"
    assert CliRunner().invoke(app, ["keygen", str(path)]).exit_code == 0
    return path


@pytest.fixture(scope="module")
def modules(key: Path) -> Modules:
    """What each side of each shipped file imports."""
    cases = [(name, side) for name in FILES for side in SIDES]
    with ThreadPoolExecutor(2) as pool:
        found = pool.map(lambda case: imported(*case, f"link.key_file={key}"), cases)
        return dict(zip(cases, found, strict=True))


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", FILES)
def test_a_daemon_imports_only_what_its_file_names(modules: Modules, name: str, side: str, key: Path) -> None:
    there = modules[name, side]
    system = load(CONFIGS / name, [f"link.key_file={key}"]).system
    scheme = system.control.scheme
    simulated = side == "slave" and system.slave.robot.driver == "simulated"
    mujoco = side == "slave" and system.slave.robot.driver == "mujoco"
    point = side == "slave" and system.slave.robot.driver == "point"
    mapped = side == "master" and system.master.mapping is not None
    turns = system.codec.rotation is not None
    picked = build_robot(load(CONFIGS / name, [f"link.key_file={key}"])).integrator if simulated else None  # type: ignore[attr-defined]
    named = {
        "cryptography": system.link.security != "none",
        "weberlink.protocol.psk": system.link.security != "none",
        "weberlink.protocol.keys": system.link.security != "none",
        "weberlink.protocol.checksum": system.link.security == "none",
        "weberlink.master.devices.replay": side == "master" and system.master.device.driver == "replay",
        "weberlink.master.devices.operator": side == "master" and system.master.device.driver == "operator",
        "weberlink.slave.robots.simulated": simulated,
        **{f"weberlink.slave.integrators.{integrator}": integrator == picked for integrator in INTEGRATORS},
        "weberlink.control.tdpa": scheme in ("tdpa", "auto"),
        "weberlink.control.mmt": scheme == "auto" or (scheme == "mmt" and side == "master"),
        "weberlink.control.auto": scheme == "auto",
        "weberlink.slave.robots.point": point,
        "weberlink.master.mapping": mapped,
        "weberlink.geometry.rotation": turns or mapped,  # which maps what a handle measures, sent or not
        "weberlink.master.rotation": turns and side == "master",
        "weberlink.master.devices.turning": turns and side == "master",
        "weberlink.slave.rotation": turns and side == "slave",
        "weberlink.slave.robots.tool": turns and point,
        "weberlink.slave.robots.mjcf.rotation": turns and mujoco,
        "weberlink.master.devices.polhem": side == "master" and system.master.device.driver == "polhem_serial",
        "weberlink.slave.robots.dynamixel": side == "slave" and system.slave.robot.driver == "dynamixel",
        "weberlink.slave.robots.mjcf": mujoco,
        "mujoco": mujoco,
        "serial": (side, name) in [("master", "phantom-arm.yaml"), ("slave", "phantom-arm.yaml")],
        "numpy": mujoco or (side == "master" and system.master.device.driver == "replay"),  # reads the trace
    }
    assert {module: module in there for module in named} == named
    # MuJoCo brings some packages of others, which nobody here asked for.
    assert not (OBSERVERS if mujoco else NEVER) & there
    assert there & ALL_HARDWARE == ({"serial", "hardware"} if named["serial"] else set())


def test_the_shipped_files_between_them_name_what_is_optional(modules: Modules) -> None:
    """Or the test above would see one answer only."""
    optional = {
        "cryptography",
        "weberlink.master.devices.replay",
        "weberlink.slave.robots.simulated",
        "weberlink.slave.integrators.exact",
        "weberlink.control.auto",
        "weberlink.control.tdpa",
        "weberlink.control.mmt",
        "weberlink.master.mapping",
        "weberlink.geometry.rotation",
        "weberlink.slave.robots.tool",
        "weberlink.slave.robots.mjcf.rotation",
        "mujoco",
        "serial",
    }
    assert optional <= frozenset().union(*modules.values())
    assert not optional & frozenset.intersection(*modules.values())


BANKS = pytest.mark.parametrize(
    ("overrides", "bank"),
    [
        (("codec.force.predictor=zoh",), ("zoh",)),
        (("codec.force.predictor=plane",), ("plane",)),
        (("codec.force.predictor=hybrid", "codec.force.bank=[sphere]"), ("sphere",)),
        (("codec.force.predictor=hybrid", "codec.force.bank=[linear, plane]"), ("linear", "plane")),
        ((), ("zoh", "linear", "plane", "sphere")),
    ],
    ids=["zoh", "plane", "hybrid of sphere", "hybrid of two", "hybrid"],
)


@BANKS
def test_only_the_named_predictors_are_built_and_chosen(overrides: tuple[str, ...], bank: tuple[str, ...]) -> None:
    channel = channels(configuration(*overrides).system)[1]
    assert channel.bank == bank
    assert channel.predictors == tuple(PREDICTORS[name] for name in bank)
    chosen = {step.slave.selected for step in steps(system(*overrides), 4.0) if step.slave.sent}
    assert chosen == set(range(len(bank)))


@dataclass(frozen=True)
class Counted(Channel):
    """A channel that counts what is fitted, by the name of the predictor."""

    fits: Counter[str] = field(default_factory=Counter)

    @property
    def predictors(self) -> tuple[Predictor, ...]:
        return tuple(
            replace(predictor, fit=self._counting(name, predictor.fit))
            for name, predictor in zip(self.bank, super().predictors, strict=True)
        )

    def _counting(self, name: str, fit: Fit) -> Fit:
        def counted(newest: Sample, previous: Sample | None, trust: Trust) -> Model:
            self.fits[name] += 1
            return fit(newest, previous, trust)

        return counted


def counted(channel: Channel) -> Counted:
    return Counted(**{each.name: getattr(channel, each.name) for each in fields(channel)})


@BANKS
def test_only_the_named_predictors_are_computed_and_on_arrival_only_the_chosen_one(
    overrides: tuple[str, ...], bank: tuple[str, ...]
) -> None:
    channel = channels(configuration(*overrides).system)[1]
    sending, receiving = counted(channel), counted(channel)
    encoder, decoder = Encoder(sending), Decoder(receiving)
    chosen: Counter[str] = Counter()
    for step in steps(system(), 3.0):
        update = encoder.encode(step.index, raw(step.slave), output(step.slave))
        if update is not None:
            decoder.apply(update)
            chosen[bank[update.selector]] += 1
        decoder.value(step.index, output(step.slave))
    assert chosen.total() > 10
    assert receiving.fits == chosen
    assert set(sending.fits) == set(bank)
    # The mirror fits what the decoder fits; a bank of several is tried as a whole, once for each send but the first.
    assert sending.fits.total() <= chosen.total() * (1 if len(bank) == 1 else 1 + len(bank))


@pytest.mark.parametrize("name", FILES)
def test_a_sample_carries_the_named_axes_only(name: str) -> None:
    loaded = load(CONFIGS / name, ["link.key_file=unread"]).system
    forward, backward = channels(loaded)
    axes = len(loaded.axes)
    assert (forward.level_count, backward.level_count) == (axes, 2 * axes)


@pytest.mark.parametrize("with_previous", [False, True])
def test_one_axis_is_shorter_on_the_wire_than_three(with_previous: bool) -> None:
    one, three = (channels(configuration(f"axes={axes}").system) for axes in ("z", "xyz"))
    for narrow, wide in zip(one, three, strict=True):
        sizes = [UpdateLayout(each.level_count).size(with_previous=with_previous) for each in (narrow, wide)]
        assert sizes[0] < sizes[1]
