"""The kernel imports nothing that only guests install; a missing package is reported with what installs it."""

import json
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest

import weberlink
from weberlink.config import ConfigurationError
from weberlink.config.errors import require_package
from weberlink.installation import install_line

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


def modules() -> list[str]:
    """All modules of the kernel, without programs."""
    root = Path(weberlink.__file__).parent
    found = []
    for folder in (root, *(path for path in root.iterdir() if path.is_dir())):
        paths = folder.glob("*.py") if folder == root else folder.rglob("*.py")
        found += [".".join(("weberlink", *path.relative_to(root).with_suffix("").parts)) for path in paths]
    return sorted(name.removesuffix(".__init__") for name in found if not name.endswith("__main__"))


def test_every_module_imports_without_the_packages_of_guests() -> None:
    command = [sys.executable, "-c", IMPORT, json.dumps([PACKAGES, modules()])]
    assert json.loads(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout) == []


def test_a_missing_package_is_named_with_the_line_that_installs_it() -> None:
    with pytest.raises(ConfigurationError) as caught:
        require_package("no_such_package", "studies", "--plots")
    assert str(caught.value) == f"--plots: needs no_such_package; install it with: {install_line('studies')}"
