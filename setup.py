"""The compiled build: `WEBERLINK_COMPILE=1 pip install .` compiles the modules below with mypyc, as one group.

Without that variable nothing is compiled, and neither mypy nor a C compiler is needed.
"""

import os
from pathlib import Path

from setuptools import setup

SOURCE = Path("src/weberlink")
COMPILED = (
    "update.py",
    "geometry/*.py",
    "codec/*.py",
    "codec/predictors/*.py",
    "control/*.py",
    "protocol/**/*.py",
    "arms/sensor.py",
    "telemetry/fault.py",
    "telemetry/ring.py",
    "telemetry/row.py",
    "realtime/garbage.py",
    "realtime/stall.py",
    "realtime/ticker.py",
    "session/channels.py",
    "session/side.py",
    "session/tuning.py",
    "master/operator_port.py",
    "master/rotation.py",
    "master/gate.py",
    "master/mapping/*.py",
    "master/devices/hand.py",
    "master/devices/hand_device.py",
    "master/devices/turning.py",
    "slave/robot_port.py",
    "slave/rotation.py",
    "slave/guard.py",
    "slave/integrators/*.py",
    "slave/robots/computed.py",
    "slave/robots/tool.py",
)
"""What a tick runs, for simulated devices and robots; the drivers of real ones wait for their hardware.

Not there: modules that define pydantic models (mypyc drops their annotations), scenes, which deepcopy() copies, and
`session/tick_loop.py`: compiled, its `await` in a `finally` clause raised an earlier exception again.
"""
PYTHON = {
    "control/table.py": "a type made of the table",
    "protocol/keys.py": "runs once",
    "protocol/paths.py": "words for people",
}
"""What stays Python of those, and why; packages (`__init__.py`) do too, as they hold names and tables only."""


def modules() -> list[str]:
    """The files to compile."""
    found = {path for pattern in COMPILED for path in SOURCE.glob(pattern) if path.name != "__init__.py"}
    return sorted(str(path) for path in found - {SOURCE / left for left in PYTHON})


def extensions() -> list:
    if os.environ.get("WEBERLINK_COMPILE") != "1":
        return []
    from mypyc.build import mypycify  # noqa: PLC0415

    found = mypycify(
        ["--config-file", "pyproject.toml", *modules()],
        group_name="weberlink",
        opt_level="2",
        debug_level="0",
        multi_file=True,  # in one file they take a compiler several times as long
        target_dir="build/mypyc",
    )
    for extension in found:
        # A fused multiply-add rounds once instead of twice: results would differ between processors, and from Python.
        # Python's own flags ask for debug information: without it a compiler needs less time, and a wheel less room.
        extension.extra_compile_args += ["-ffp-contract=off", "-g0"]
    return found


if __name__ == "__main__":
    setup(ext_modules=extensions())
