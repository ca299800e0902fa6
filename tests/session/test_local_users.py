"""A live session on a host whose other users are in the way."""

import os
import shutil
import subprocess
import sys

import pytest

from tests.program import ROOT
from tests.strangers import needs_root
from tests.wait import PATIENCE

pytestmark = pytest.mark.realtime

CROWDED = """
import signal
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
with Program("loopback", "--json", "-", "--set", "link.silence_ms=2000") as program:
    program.engaged("master")
    assert list(find_rings(None)) == [str(program.pid)]
    program.send(signal.SIGINT)
    status, output, errors = program.finish()
assert (status, errors) == (0, ""), errors
assert document(output)["outcome"] == "interrupted"
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
        cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=3 * PATIENCE,
    )  # fmt: skip
    if "unshare failed" in ended.stderr:
        pytest.skip("no mount namespace here")
    assert ended.returncode == 0, ended.stderr
