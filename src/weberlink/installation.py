"""How this program was installed, for messages that name a command of pip."""

import os
import sys
from importlib.util import find_spec
from pathlib import Path
from shlex import quote
from shutil import which


def install_line(extra: str) -> str:
    """The command that adds an extra to this installation, to be typed in the present directory."""
    clone = Path(__file__).resolve().parents[2]
    if not (clone / "pyproject.toml").is_file():
        return f'{pip_install()} "weberlink[{extra}]"'
    where = "." if clone == Path.cwd() else str(clone)
    return f'{pip_install()} -e "{where}[{extra}]"'


def pip_install() -> str:
    """How to call the installer of this environment; that of another one would install there."""
    beside = Path(sys.executable).parent / "pip"
    if beside.is_file():
        found = which("pip")
        return f"{'pip' if found is not None and Path(found) == beside else quote(_short(beside))} install"
    python = quote(_short(Path(sys.executable)))
    return f"{python} -m pip install" if find_spec("pip") is not None else f"uv pip install --python {python}"


def _short(path: Path) -> str:
    """A path below the present directory as it is typed there; any other one whole."""
    here = Path.cwd()
    return os.path.relpath(path, here) if path.is_relative_to(here) else str(path)
