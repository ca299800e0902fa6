"""Optional packages: what each part of the project may import, and how a missing one is reported."""

import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest

import weberlink
from weberlink.system.configuration import ConfigurationError
from weberlink.system.configuration.extras import need

PACKAGES = {
    "monitor": ("aiohttp", "prometheus_client"),
    "recording": ("mcap", "zstandard"),
    "mujoco": ("mujoco",),
    "plots": ("matplotlib",),
    "dask": ("distributed",),
    "others": ("scipy", "pyarrow"),
}
"""Import names of what an extra installs."""
PLACES = {
    "monitor": ("apps.monitor",),
    "recording": ("telemetry.recording", "system.scoring.recorded", "apps.ros_export", "apps.monitor.replay"),
    "mujoco": ("slave.robots.mjcf",),
    "plots": ("studies",),
    "dask": ("studies.cluster",),
}
"""Where each extra may be imported at the top of a module."""
IMPORT = dedent("""
    import sys
    from importlib import import_module

    class Hidden:
        def find_spec(self, name, path=None, target=None):
            if name.partition(".")[0] in hidden:
                raise ModuleNotFoundError(f"No module named {name!r}")

    hidden, modules = sys.argv[1].split(), sys.argv[2:]
    sys.meta_path.insert(0, Hidden())
    for name in modules:
        try:
            import_module(name)
        except ModuleNotFoundError as error:
            print(f"{name}: {error}")
""")


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


@pytest.mark.parametrize("extras", sorted({extras_of(name) for name in modules()}, key=sorted), ids=sorted)
def test_modules_import_with_the_extras_of_their_place_alone(extras: frozenset[str]) -> None:
    names = [name for name in modules() if extras_of(name) == extras]
    hidden = " ".join(package for extra in set(PACKAGES) - extras for package in PACKAGES[extra])
    run = subprocess.run([sys.executable, "-c", IMPORT, hidden, *names], capture_output=True, text=True, check=True)
    assert run.stdout == ""


def test_a_missing_package_is_named_with_the_line_that_installs_it() -> None:
    with pytest.raises(ConfigurationError) as caught:
        need("no_such_package", "plots", "--plots")
    assert str(caught.value) == '--plots: needs no_such_package; install it with: pip install "weberlink[plots]"'


def test_a_package_that_is_there_is_no_matter() -> None:
    need("numpy", "plots", "--plots")
