"""The controller process with the stand-in in place of `pylibfranka`."""

import sys
from pathlib import Path

from tests.slave.robots.franka import library

ROOT = Path(__file__).parents[4]
PROGRAM = (
    sys.executable,
    "-c",
    f"import sys; sys.path.insert(0, {str(ROOT)!r}); from tests.slave.robots.franka.program import main; main()",
)
"""Command that starts it, for `FrankaRobot`."""


def main() -> None:
    sys.modules["pylibfranka"] = library
    from weberlink.slave.robots.franka import controller  # noqa: PLC0415

    sys.exit(controller.main(sys.argv[1:]))
