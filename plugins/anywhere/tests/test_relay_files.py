"""The files of the relay: systemd accepts them, and a secret that is none is refused."""

import subprocess
from pathlib import Path

import pytest

from tests.test_operation import assert_accepted_and_little_exposed

FILES = Path(__file__).parents[1] / "configs" / "relay"
UNITS = ["weberlink-relay.service", "weberlink-mailbox.service"]


@pytest.mark.parametrize("name", UNITS)
def test_systemd_accepts_the_unit_and_finds_it_little_exposed(name: str, tmp_path: Path) -> None:
    assert_accepted_and_little_exposed(FILES / name, tmp_path, most=15)


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
