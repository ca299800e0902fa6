"""Live sessions on a host with other users, who are in the way or look on."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.program import ROOT, Program, document
from tests.strangers import as_stranger, needs_root, read_file
from tests.wait import PATIENCE, until
from weberlink.system import description
from weberlink.telemetry.ring import default_path

pytestmark = pytest.mark.realtime

CROWDED = """
from pathlib import Path
from weberlink.telemetry.ring import RingWriter
from tests.strangers import *
from tests.program import Program, document
from weberlink.watching.rings import find_rings

shared = Path("/dev/shm")
as_stranger(squat_directory, shared / "weberlink-0")
as_stranger(squat_directory, shared / "weberlink-0.suffix", user=SOMEBODY)
for number in range(1, 50):
    as_stranger(squat_fifo, shared / "weberlink-0" / f"weberlink-{number}-master.ring")
with RingWriter.create(shared / "own", side="master", rate_hz=1000.0, capacity=4) as ring:
    forged = ring.path.read_bytes()
for folder in ("weberlink-0", "."):
    as_stranger(squat_file, shared / folder / "weberlink-777-master.ring", forged)
    as_stranger(squat_large, shared / folder / "weberlink-777-master.json")
with Program("loopback", "--duration", "1", "--json", "-") as program:
    program.engaged("master")
    assert list(find_rings(None)) == [str(program.pid)]
    status, output, errors = program.finish()
assert (status, errors) == (0, ""), errors
assert document(output)["outcome"] == "completed"
assert find_rings(None) == {}
"""


@needs_root
def test_files_of_other_users_do_no_harm() -> None:
    """With a /dev/shm of its own, which is mounted for the test alone."""
    if shutil.which("unshare") is None:
        pytest.skip("no unshare here (Debian's util-linux)")
    command = 'mount -t tmpfs -o mode=1777 tmpfs /dev/shm && exec "$0" -c "$1"'
    environment = {name: value for name, value in os.environ.items() if name != "XDG_RUNTIME_DIR"}
    ended = subprocess.run(
        ["unshare", "--mount", "sh", "-c", command, sys.executable, CROWDED],
        cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE,
    )  # fmt: skip
    if "unshare failed" in ended.stderr:
        pytest.skip("no mount namespace here")
    assert ended.returncode == 0, ended.stderr


def test_loopback_key_is_removed_after_reading() -> None:
    with Program("loopback", "--duration", "1", "--json", "-", "--set", "link.security=session") as program:
        key = default_path("any").parent / f"weberlink-{program.pid}.key"
        until(lambda: key.exists() and key.stat().st_size, "the key")
        assert key.stat().st_mode & 0o777 == 0o600
        if os.geteuid() == 0:
            assert as_stranger(read_file, key) == "refused"
        digits = key.read_text().split()[1]
        program.engaged("master")
        until(lambda: not key.exists(), "the key to be removed")
        described = description.read(default_path(f"{program.pid}-master"))
        assert described is not None and described["system"]["link"]["security"] == "session"
        commands = [Path(f"/proc/{pid}/cmdline").read_bytes() for pid in program.daemons()]
        assert commands and digits.encode() not in b"".join(commands)
        for pid in program.daemons():
            limit = next(line for line in Path(f"/proc/{pid}/limits").read_text().splitlines() if "core" in line)
            assert limit.split()[4:6] in (["1", "1"], ["0", "0"])
        status, output, errors = program.finish()
    assert (status, errors) == (0, "")
    assert "bad_tag" not in document(output)["drops"]["master"]


@pytest.mark.parametrize("side", ["master", "slave"])
def test_single_side_has_no_session_key(side: str) -> None:
    address = ("--set", "link.listen=127.0.0.1:47999", "--set", "link.slave=127.0.0.1:47999")
    with Program(side, ROOT / "configs" / "loopback.yaml", *address, "--set", "link.security=session") as program:
        status, output, errors = program.finish()
    assert (status, output) == (2, "")
    assert "link.security: session is for weberlink loopback" in errors
    assert len(errors.splitlines()) == 1
