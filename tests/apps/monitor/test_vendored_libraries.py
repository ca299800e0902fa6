"""The bundled libraries are the published ones."""

import runpy
import subprocess
import sys
from pathlib import Path

import weberlink.apps.monitor

VENDOR = Path(weberlink.apps.monitor.__file__).parent / "page" / "vendor"
FETCH = runpy.run_path(str(VENDOR / "fetch.py"))


def test_libraries_match_the_manifest() -> None:
    check = subprocess.run(
        [sys.executable, VENDOR / "fetch.py", "--check"], capture_output=True, text=True, check=False
    )
    assert (check.returncode, check.stderr) == (0, "")


def test_changed_library_is_detected(tmp_path: Path) -> None:
    for path in VENDOR.glob("*.*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "uplot.js").write_bytes((tmp_path / "uplot.js").read_bytes() + b"\n")
    (tmp_path / "three.LICENSE").unlink()
    check = subprocess.run(
        [sys.executable, tmp_path / "fetch.py", "--check"], capture_output=True, text=True, check=False
    )
    assert check.returncode == 1
    assert check.stderr.splitlines() == ["uplot.js: not the file of uplot 1.6.32", "three.LICENSE: missing"]


def test_readme_and_manifest_agree() -> None:
    readme = (VENDOR / "README.md").read_text(encoding="utf-8")
    here = {path.name for path in VENDOR.iterdir() if path.is_file()} - {"README.md", "manifest.json", "fetch.py"}
    listed = set()
    for library in FETCH["manifest"]():
        row = next(line for line in readme.splitlines() if line.startswith(f"| [{library['name']}]"))
        assert f"| {library['version']} | {library['licence']} " in row
        assert library["integrity"] in row
        listed |= {entry["as"] for entry in library["files"]}
        assert all(f"`{entry['as']}`" in row for entry in library["files"])
    assert listed == here
