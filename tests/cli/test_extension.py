"""A command of another distribution, found by its entry point."""

import os
import subprocess
import sys
from pathlib import Path

from tests.system.packages import install

COMMAND = '''
import typer

from weberlink.cli.arguments import File
from weberlink.system.configuration import load


def rate(file: File) -> None:
    """Print the tick rate of FILE."""
    typer.echo(f"{load(file).system.rate_hz:g} Hz")
'''


def test_command_of_another_distribution_runs(tmp_path: Path) -> None:
    install(tmp_path, "rate-command", {"rate_command": COMMAND}, "[weberlink.commands]\nrate = rate_command:rate")
    root = Path(__file__).parents[2]
    ended = subprocess.run(
        [sys.executable, "-m", "weberlink", "rate", str(root / "configs" / "loopback.yaml")],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "1000 Hz\n", "")
