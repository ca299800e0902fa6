"""The line that adds an extra is one that works here: in a clone, of one that was installed, and of a wheel."""

import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from weberlink import installation

ROOT = Path(__file__).parents[1]
PRINTING = "import sys; from weberlink.installation import install_line; print(install_line(sys.argv[1]))"


def line(folder: Path, package: Path, path: str | None = None, extra: str = "docs") -> list[str]:
    """The words of the line that a program in a folder prints, where `weberlink` is imported from `package`."""
    environment = {"PYTHONPATH": str(package), "PATH": os.environ["PATH"] if path is None else path}
    ended = subprocess.run(
        [sys.executable, "-c", PRINTING, extra],
        cwd=folder,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return shlex.split(ended.stdout)


@pytest.fixture
def wheel(tmp_path: Path) -> Path:
    """A folder of installed packages."""
    package = tmp_path / "lib" / "python3" / "site-packages" / "weberlink"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    for path in (installation.__file__, installation.GUESTS):
        shutil.copy(path, package)
    return package.parent


LINES = [  # in a clone also the guests that a guest needs
    ("docs", [".[docs]"], [f"{ROOT}[docs]"], "weberlink[docs]"),
    ("predictors", ["./plugins/predictors"], [f"{ROOT}/plugins/predictors"], "weberlink-predictors"),
    (
        "studies[dask]",
        ["./plugins/figures", "./plugins/predictors", "./plugins/studies[dask]"],
        [f"{ROOT}/plugins/{name}" for name in ("figures", "predictors", "studies[dask]")],
        "weberlink-studies[dask]",
    ),
]


@pytest.mark.parametrize(("extra", "here", "elsewhere", "of_a_wheel"), LINES)
def test_a_clone_is_installed_anew_and_a_wheel_by_its_name(
    extra: str, here: list[str], elsewhere: list[str], of_a_wheel: str, wheel: Path, tmp_path: Path
) -> None:
    for folder, expected in ((ROOT, here), (tmp_path, elsewhere)):
        words = line(folder, ROOT / "src", extra=extra)
        assert words[words.index("install") + 1 :] == [word for each in expected for word in ("-e", each)]
    assert line(tmp_path, wheel, extra=extra)[-2:] == ["install", of_a_wheel]


def test_of_an_installed_clone_its_folder_is_named(wheel: Path, tmp_path: Path) -> None:
    told = wheel / "weberlink-0.1.0.dist-info" / "direct_url.json"
    told.parent.mkdir()
    for folder, expected in ((ROOT, f"{ROOT}/plugins/devices"), (tmp_path / "gone", "weberlink-devices")):
        told.write_text(json.dumps({"dir_info": {}, "url": folder.as_uri()}))
        assert line(tmp_path, wheel, extra="devices")[-2:] == ["install", expected]


def test_it_is_the_installer_of_this_environment(wheel: Path, tmp_path: Path) -> None:
    """That of the first environment on the path may be another one."""
    words = line(tmp_path, wheel, path="/usr/bin:/bin")
    told = subprocess.run(
        [*words[: words.index("install")], "--version"], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout
    assert told.startswith("uv ") or f" from {sys.prefix}/" in told
