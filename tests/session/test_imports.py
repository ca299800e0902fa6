"""A daemon imports, builds, computes and sends only what its file names."""

import json
import subprocess
import sys
from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest
from typer.testing import CliRunner

import weberlink
from tests.session.systems import ARMS, CONFIGS, HAS_ARMS
from weberlink.cli import app
from weberlink.config import ConfigurationError, load
from weberlink.config.errors import require_package
from weberlink.installation import install_line
from weberlink.session.composition.slave import build_robot
from weberlink.slave.integrators import INTEGRATORS

# Between them these files name every optional part, and each part is left out by another.
NAMED = ("delay", "lan", "loopback", "phantom", "replay", "rotation")
FILES = (*([str(ARMS)] if HAS_ARMS else []), *(f"{name}.yaml" for name in (*NAMED, "scene-simulated-robot")))
SIDES = ("master", "slave")
BUILD = """
import json, os, sys
from pathlib import Path
import weberlink.session.daemon
from weberlink.session.composition.link import Context, build_security
from weberlink.session.composition.sides import build_side
from weberlink.config import load
from weberlink.config.model import split_address

def build(file, side, *overrides):
    configuration = load(Path(file), overrides, sides=[side])
    peer = split_address(configuration.system.link.slave) if side == "master" else None
    build_side(configuration, side, Context(build_security(configuration), os.urandom, 0.0, peer=peer))
    print(json.dumps(sorted(sys.modules)), flush=True)

for arguments in json.loads(sys.argv[1]):
    if (child := os.fork()) == 0:
        build(*arguments)
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        sys.exit(f"{arguments} failed")
"""
"""Builds each case in a process of its own, forked from one that has imported what every daemon imports."""
OBSERVERS = {
    *(f"weberlink.{name}" for name in ("cli", "session.launcher", "session.report", "session.summary")),
    *(
        f"weberlink_{name}"
        for name in ("anywhere", "arms", "figures", "foxglove", "franka", "predictors", "ros2", "studies")
    ),
    *("matplotlib", "scipy"),
    *("aioice", "twisted", "wormhole", "foxglove", "pylibfranka", "rosbags", "websockets", "zenoh"),
}
"""What watches a daemon, and what is of other systems and makers; none of these files names one."""
WEB_AND_TERMINAL = {"aiohttp", "http.server", "typer", "click", "rich"}
HARDWARE = {"serial", "hid", "hidraw", "weberlink.hardware"}


@pytest.fixture(scope="module")
def key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("imports") / "weberlink.key"
    assert CliRunner().invoke(app, ["keygen", str(path)]).exit_code == 0
    return path


@pytest.fixture(scope="module")
def modules(key: Path) -> dict[tuple[str, str], frozenset[str]]:
    """Modules of a process that has built one side of a file."""
    cases = [(name, side) for name in FILES for side in SIDES]
    arguments = [(str(CONFIGS / name), side, f"link.key_file={key}") for name, side in cases]
    ended = subprocess.run(
        [sys.executable, "-c", BUILD, json.dumps(arguments)],
        cwd=CONFIGS.parent,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    return {case: frozenset(json.loads(line)) for case, line in zip(cases, ended.stdout.splitlines(), strict=True)}


def expected(name: str, side: str, key: Path) -> dict[str, bool]:
    loaded = load(CONFIGS / name, [f"link.key_file={key}"])
    system, master, slave = loaded.system, side == "master", side == "slave"
    scheme, turns = system.control.scheme, system.codec.rotation is not None
    device, robot = system.master.device.driver, system.slave.robot.driver
    arms = system.codec.joints is not None
    simulated = slave and robot == "simulated"
    mapped = master and system.master.mapping is not None
    secured = system.link.security != "none"
    integrator: Any = build_robot(loaded).integrator if simulated else None  # type: ignore[attr-defined]
    follows = slave and robot in ("point", "simulated") and "stiffness_n_m" not in system.slave.robot.options
    builds_device = master or follows  # its stiffness is that of the robot
    plugged = master and device == "polhem_serial"
    return {
        "cryptography": secured,
        "weberlink.protocol.psk": secured,
        "weberlink.control.bounded": scheme == "bounded" and not arms,
        "weberlink_mujoco": arms,
        "weberlink.geometry.rotation": turns or mapped,
        "weberlink.master.mapping": mapped,
        "weberlink.master.rotation": turns and master,
        "weberlink.master.devices.turning": turns and builds_device and device == "operator",
        "weberlink.master.devices.operator": builds_device and device == "operator",
        "weberlink.master.devices.replay": builds_device and device == "replay",
        "weberlink.master.devices.polhem": builds_device and device == "polhem_serial",
        "weberlink.slave.rotation": turns and slave,
        "weberlink.slave.robots.tool": turns and slave and robot == "point",
        "weberlink.slave.robots.simulated": simulated,
        **{f"weberlink.slave.integrators.{each}": each == integrator for each in INTEGRATORS},
        "mujoco": arms,
        "numpy": arms or (builds_device and device == "replay"),
        "serial": plugged,
        "weberlink.hardware": plugged,
    }


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", FILES)
def test_daemon_imports_only_what_its_file_names(
    modules: dict[tuple[str, str], frozenset[str]], name: str, side: str, key: Path
) -> None:
    there, named = modules[name, side], expected(name, side, key)
    assert {module: module in there for module in named} == named
    # MuJoCo itself imports some of the packages for web and terminal.
    assert not (OBSERVERS | (set() if named["mujoco"] else WEB_AND_TERMINAL)) & there
    assert there & HARDWARE == {module for module in ("serial", "weberlink.hardware") if named[module]}


# --- without guests

PACKAGES = (
    *("aiohttp", "aioice", "cv2", "distributed", "evdev", "foxglove", "matplotlib", "mcap", "mujoco", "pandas"),
    *("prometheus_client", "pyarrow", "pylibfranka", "rosbags", "scipy", "segno", "statsmodels", "twisted"),
    *("websockets", "wormhole", "zenoh", "zstandard"),
)
"""Import names of what guests install."""
IMPORT = dedent("""
    import json, sys
    from importlib import import_module

    packages, modules = json.loads(sys.argv[1])

    class Hidden:
        def find_spec(self, name, path=None, target=None):
            if name.partition(".")[0] in packages:
                raise ModuleNotFoundError(f"No module named {name!r}")

    sys.meta_path.insert(0, Hidden())
    failed = []
    for name in modules:
        try:
            import_module(name)
        except ModuleNotFoundError as error:
            failed.append(f"{name}: {error}")
    print(json.dumps(failed))
""")


def modules_of_the_kernel() -> list[str]:
    root = Path(weberlink.__file__).parent
    found = []
    for folder in (root, *(path for path in root.iterdir() if path.is_dir())):
        paths = folder.glob("*.py") if folder == root else folder.rglob("*.py")
        found += [".".join(("weberlink", *path.relative_to(root).with_suffix("").parts)) for path in paths]
    return sorted(name.removesuffix(".__init__") for name in found if not name.endswith("__main__"))


def test_every_module_imports_without_the_packages_of_guests() -> None:
    command = [sys.executable, "-c", IMPORT, json.dumps([PACKAGES, modules_of_the_kernel()])]
    assert json.loads(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout) == []


def test_a_missing_package_is_named_with_the_line_that_installs_it() -> None:
    with pytest.raises(ConfigurationError) as caught:
        require_package("no_such_package", "studies", "--plots")
    assert str(caught.value) == f"--plots: needs no_such_package; install it with: {install_line('studies')}"
