"""The controller process with the stand-in in place of `pylibfranka`."""

import sys
from pathlib import Path

from plugins.franka.tests import library

ROOT = Path(__file__).parents[3]
PROGRAM = (
    sys.executable,
    "-c",
    f"import sys; sys.path.insert(0, {str(ROOT)!r}); from plugins.franka.tests.program import main; main()",
)
"""Command that starts it, for `FrankaRobot`."""


def main() -> None:
    sys.modules["pylibfranka"] = library
    from weberlink_franka import controller  # noqa: PLC0415

    sys.exit(controller.main(sys.argv[1:]))
