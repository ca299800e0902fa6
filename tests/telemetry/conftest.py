"""Real processes at either end of a ring."""

import os
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def start():
    """Starts a script of this directory, returns it once it is ready, and ends it with the test."""
    with ExitStack() as running:

        def start(script, *arguments):
            process = subprocess.Popen(
                [sys.executable, Path(__file__).with_name(script), *map(str, arguments)],
                stdout=subprocess.PIPE,
                env=os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), os.environ.get("PYTHONPATH", "")))},
            )
            running.enter_context(process)
            running.callback(process.kill)
            assert process.stdout.readline() == b"ready\n"
            return process

        yield start
