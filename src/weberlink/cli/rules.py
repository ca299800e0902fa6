"""Installs and checks the udev rules that give users access to devices: files *.rules beside the configurations.

Every installed distribution may have one, in the package that it names under `weberlink.configs`.
"""

import grp
import os
import pwd
import shlex
import shutil
import stat
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib.resources import files
from pathlib import Path

from weberlink.child_process import python
from weberlink.cli.output import CommandError
from weberlink.installation import CONFIGS, config_folders, entries

RULES_DIR = Path("/etc/udev/rules.d")
FOLDERS = (RULES_DIR, Path("/usr/lib/udev/rules.d"), Path("/lib/udev/rules.d"))  # folders that udev reads rules from
MATCHED = [f"--subsystem-match={name}" for name in ("hidraw", "tty", "usb")]  # of the devices that the rules cover
SUDO_FOLDERS = ("/usr/local/bin", "/usr/bin", "/bin")  # folders that sudo searches for programs


def shipped() -> dict[str, str]:
    """The rules of the installed distributions, by the names of their files."""
    paths = (path for folder in config_folders() for path in sorted(folder.glob("*.rules")))
    return {path.name: path.read_text(encoding="utf-8") for path in paths}


def covers(package: str | None) -> bool:
    """Whether a distribution brings rules for its devices; None for this program's own drivers."""
    own = (each for each in entries(CONFIGS).values() if each.dist is not None and each.dist.name == package)
    return package is None or any(any(Path(str(files(each.module))).glob("*.rules")) for each in own)


def installed(folders: Sequence[Path] = FOLDERS) -> bool:
    """Whether all these rules are installed."""

    def has(path: Path, text: str) -> bool:
        try:
            return path.read_text(encoding="utf-8") == text
        except (OSError, UnicodeDecodeError):
            return False

    return all(any(has(folder / name, text) for folder in folders) for name, text in shipped().items())


def install(folder: Path = RULES_DIR, udevadm: str | None = None) -> str:
    """Copy the rules and let udev apply them to plugged devices; returns what to show. Raises CommandError if they
    cannot be written; no file is left half written."""
    rules = shipped()
    for name, text in rules.items():
        _write(folder / name, text)
    problem = _apply(udevadm or shutil.which("udevadm"))
    paths = " and ".join(str(folder / name) for name in rules)
    if problem is None:
        return f"{paths}: installed, and applied to plugged devices"
    return f"{paths}: installed; {problem}, so unplug the devices and plug them in again, or restart"


def _write(target: Path, text: str) -> None:
    draft = target.with_name(f".{target.name}.{os.getpid()}")  # udev reads only what ends in .rules
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        draft.write_text(text, encoding="utf-8")
        draft.chmod(0o644)
        draft.replace(target)
    except PermissionError:
        raise CommandError(f"{target.parent}: only root may write there; run: {install_line()}") from None
    except OSError as error:
        raise CommandError(f"{target}: cannot be written: {error.strerror}") from None
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def install_line() -> str:
    """The command that installs the rules; with a full path where sudo does not search, as in a virtual environment."""
    program = Path(sys.executable).with_name("weberlink")
    if any(Path(folder, "weberlink").exists() for folder in SUDO_FOLDERS):
        return "sudo weberlink device rules"
    words = [str(program)] if program.exists() else python("-m", "weberlink")
    return f"sudo {shlex.join(words)} device rules"


def group_line(path: str) -> str | None:
    """How to join the group that may open a device, if this process lacks that alone."""
    try:
        status = os.stat(path)  # noqa: PTH116 - a device, not a file to read
        group = grp.getgrgid(status.st_gid)
    except (OSError, KeyError):
        return None
    may = status.st_mode & (stat.S_IRGRP | stat.S_IWGRP) == stat.S_IRGRP | stat.S_IWGRP
    if not may or status.st_gid == 0 or status.st_gid in (*os.getgroups(), os.getegid()):
        return None
    with suppress(KeyError):  # of a user without a name
        if pwd.getpwuid(os.getuid()).pw_name in group.gr_mem:
            return f"log out and in again: you are in the group {group.gr_name}, but this login began before that"
    return f"sudo usermod -aG {group.gr_name} $USER    (then log out and in again)"


def _apply(udevadm: str | None) -> str | None:
    """Let udev apply the rules to plugged devices; returns an error, or None."""
    if udevadm is None:
        return "there is no udevadm here"
    for arguments in (["control", "--reload"], ["trigger", "--action=change", *MATCHED]):
        try:
            done = subprocess.run([udevadm, *arguments], capture_output=True, text=True, timeout=30, check=False)  # noqa: S603
        except (OSError, subprocess.TimeoutExpired) as error:
            return f"{udevadm} cannot be run ({error})"
        if done.returncode != 0:
            complaint = " ".join(done.stderr.split()) or f"exit status {done.returncode}"
            return f"udevadm {arguments[0]} refused ({complaint})"
    return None
