"""Compiles the stand-ins for the makers' libraries; skips a test where there is no C compiler."""

import atexit
import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pytest


@cache
def compiled(source: Path, name: str, into: Path | None = None) -> Path:
    """The library made of a source, of that name in a folder; a new one if none is given."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler here")
    if into is None:
        into = Path(mkdtemp(prefix="weberlink-library-"))
        atexit.register(shutil.rmtree, into, ignore_errors=True)
    flags = ["-O1", "-Wall", "-Werror", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "-o", into / name, source, "-lm", "-lpthread"], check=True, timeout=60)
    return into / name
