"""Optional packages: what each part of the project may import, and how a missing one is reported."""

import json
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest

import weberlink
from weberlink.installation import install_line
from weberlink.system.configuration import ConfigurationError
from weberlink.system.configuration.extras import need

PACKAGES = {
    "monitor": ("aiohttp", "prometheus_client"),
    "guests": (
        *("aioice", "distributed", "evdev", "foxglove", "matplotlib", "mcap", "mujoco", "pandas", "pyarrow"),
        *("pylibfranka", "rosbags", "scipy", "segno", "statsmodels", "twisted", "websockets", "wormhole", "zenoh"),
        "zstandard",
    ),
}
"""Import names of what an extra, or a guest, installs."""
PLACES = {
    "monitor": ("apps.monitor",),
}
"""Where each extra may be imported at the top of a module."""
IMPORT = dedent("""
    import json, os, sys
    from importlib import import_module

    class Hidden:
        packages = ()

        def find_spec(self, name, path=None, target=None):
            if name.partition(".")[0] in self.packages:
                raise ModuleNotFoundError(f"No module named {name!r}")

    def look(packages, modules):
        Hidden.packages, failed = packages, []
        for name in modules:
            try:
                import_module(name)
            except ModuleNotFoundError as error:
                failed.append(f"{name}: {error}")
        print(json.dumps(failed), flush=True)

    first, *others = json.loads(sys.argv[1])
    sys.meta_path.insert(0, Hidden())
    look(*first)
    for other in others:
        if (child := os.fork()) == 0:
            look(*other)
            os._exit(0)
        if os.waitpid(child, 0)[1]:
            sys.exit("a process failed")
""")
"""Imports each group of modules without some packages; those after the first in processes forked from the first."""


def modules() -> list[str]:
    """All modules of the project, without programs."""
    root = Path(weberlink.__file__).parent
    found = []
    for folder in (root, *(path for path in root.iterdir() if path.is_dir())):
        paths = folder.glob("*.py") if folder == root else folder.rglob("*.py")
        found += [".".join(("weberlink", *path.relative_to(root).with_suffix("").parts)) for path in paths]
    return sorted(name.removesuffix(".__init__") for name in found if not name.endswith("__main__"))


def is_in(name: str, extra: str) -> bool:
    return any(f"{name}.".startswith(f"weberlink.{place}.") for place in PLACES.get(extra, ()))


def extras_of(name: str) -> frozenset[str]:
    return frozenset(extra for extra in PLACES if is_in(name, extra))


GROUPS = sorted({extras_of(name) for name in modules()}, key=sorted)
"""The first has no extra."""


@pytest.fixture(scope="module")
def failures() -> dict[frozenset[str], list[str]]:
    """What cannot be imported of the modules that may use these extras."""
    installed = {extras: {package for extra in extras for package in PACKAGES[extra]} for extras in GROUPS}
    everything = {package for packages in PACKAGES.values() for package in packages}
    arguments = [
        (sorted(everything - installed[extras]), [name for name in modules() if extras_of(name) == extras])
        for extras in GROUPS
    ]
    command = [sys.executable, "-c", IMPORT, json.dumps(arguments)]
    run = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return dict(zip(GROUPS, map(json.loads, run.stdout.splitlines()), strict=True))


@pytest.mark.parametrize("extras", GROUPS, ids=sorted)
def test_modules_import_with_the_extras_of_their_place_alone(
    failures: dict[frozenset[str], list[str]], extras: frozenset[str]
) -> None:
    assert failures[extras] == []


def test_a_missing_package_is_named_with_the_line_that_installs_it() -> None:
    with pytest.raises(ConfigurationError) as caught:
        need("no_such_package", "studies", "--plots")
    assert str(caught.value) == f"--plots: needs no_such_package; install it with: {install_line('studies')}"
