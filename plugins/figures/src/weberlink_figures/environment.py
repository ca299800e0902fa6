"""Machine, versions and commit, for the footer of published figures."""

import os
import platform
import subprocess
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from weberlink.compiled import build, is_compiled

PACKAGES = ("weberlink", "numpy", "uvloop", "cryptography", "scipy")


def environment() -> dict[str, Any]:
    """Machine, system, versions and commit; a value is None where unknown."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    packages: dict[str, str | None] = dict.fromkeys(PACKAGES)
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            packages[name] = version(name)
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "machine": names[0] if names else platform.machine(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "compiled": is_compiled(),
        "packages": packages,
        "commit": _commit(),
    }


def footer(facts: dict[str, Any], seed: int | None = None) -> str:
    """Format `environment()` as one line."""
    packages = ", ".join(f"{name} {number}" for name, number in facts["packages"].items() if number)
    parts = [
        f"{facts['machine']} x{facts['cores']}",
        facts["system"],
        f"Python {facts['python']}",
        packages,
        build(compiled=facts.get("compiled", False)),
        f"commit {facts['commit'] or 'unknown'}",
    ]
    if seed is not None:
        parts.append(f"seed {seed}")
    return "; ".join(parts)


def _commit() -> str | None:
    """The commit of the checkout of this file, with + if it has changes; None outside a checkout."""
    here = Path(__file__).resolve()

    def git(*words: str) -> str:
        command = ["git", "-C", str(here.parent), *words]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=5).stdout.strip()  # noqa: S603

    try:
        git("ls-files", "--error-unmatch", here.name)
        return git("describe", "--always", "--dirty=+", "--exclude=*")
    except (OSError, subprocess.SubprocessError):
        return None
