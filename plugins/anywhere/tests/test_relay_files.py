"""The files of the relay fit each other and their page, and systemd and Compose accept them."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.test_operation import systemd_analyze

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
FILES = ROOT / "configs" / "relay"
UNITS = ["weberlink-relay.service", "weberlink-mailbox.service"]
PAGE = (ROOT.parents[1] / "docs" / "relay.md").read_text(encoding="utf-8")
FOLDER = "/opt/weberlink-relay"


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """The units, with programs that are there."""
    for name in UNITS:
        text = (FILES / name).read_text(encoding="utf-8")
        replaced = re.sub(rf"^ExecStart={FOLDER}\S+", f"ExecStart={sys.executable}", text, flags=re.M)
        (tmp_path / name).write_text(replaced, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("name", UNITS)
def test_systemd_accepts_the_unit_and_finds_it_little_exposed(name: str, installed: Path) -> None:
    verified = systemd_analyze("verify", "--man=no", installed / name)
    assert (verified.returncode, [line for line in verified.stderr.splitlines() if name in line]) == (0, [])
    done = systemd_analyze("security", "--offline=true", "--threshold=15", "--no-pager", installed / name)
    if "unrecognized option" in done.stderr:
        pytest.skip("this systemd-analyze does not look at files")
    assert done.returncode == 0, done.stdout.splitlines()[-1:]


@pytest.mark.parametrize(
    ("secret", "reason"), [("short", "shorter than 16"), ("two words in the file", "something else than one word")]
)
def test_relay_with_an_unusable_secret_does_not_start(tmp_path: Path, secret: str, reason: str) -> None:
    (tmp_path / "secret").write_text(secret)
    command = [str(FILES / "relay.sh"), str(tmp_path / "secret")]
    environment = {"RUNTIME_DIRECTORY": str(tmp_path), "PATH": "/usr/bin:/bin"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, reason in done.stderr) == (2, True)
    assert not (tmp_path / "turnserver.conf").exists()
