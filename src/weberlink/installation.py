"""How this program was installed: its guests (distributions that add to it), and the command of pip that adds one."""

import json
import os
import sys
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from shlex import quote
from shutil import which
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GUESTS = Path(__file__).with_name("guests.json")
"""Made by `make schema`: group of entry points, name, and the guest that has the entry; of files for `CONFIGS`."""
NEEDED = "needed guests"  # what is listed beside the groups: by guest, the guests that it depends on
CONFIGS = "weberlink.configs"  # the group of packages that hold configuration files; also the kernel's own


@cache
def _listed() -> Mapping[str | None, Mapping[str, str]]:
    listed: Mapping[str | None, Mapping[str, str]] = json.loads(GUESTS.read_text(encoding="utf-8"))
    return listed


def guests(group: str | None) -> Mapping[str, str]:
    """The guests of this project by the names that they add to a group of entry points, installed or not."""
    return _listed().get(group, {})


def all_guests() -> set[str]:
    """Names of the guests of this project that extend a table or have files, installed or not."""
    return {guest for group, names in _listed().items() if group != NEEDED for guest in names.values()}


def entries(group: str | None) -> Mapping[str, "EntryPoint"]:
    """The entry points of a group by name, of every distribution that is installed; none for None."""
    return {} if group is None else _installed(group, tuple(sys.path))


@cache
def _installed(group: str, path: tuple[str, ...]) -> Mapping[str, "EntryPoint"]:  # noqa: ARG001 - the key of the cache
    from importlib.metadata import entry_points  # noqa: PLC0415 - with its parsers as long an import as all of ours

    return {entry.name: entry for entry in entry_points(group=group)}


def config_modules() -> list[str]:
    """The packages of configuration files: the program's own, then those of the guests that are installed."""
    return [CONFIGS, *(entry.module for entry in entries(CONFIGS).values())]


def config_folders() -> list[Path]:
    """Where these packages are."""
    return [Path(str(files(module))).resolve() for module in config_modules()]


def absence(what: str, guest: str) -> str:
    """Says that something is of a guest that is not installed, and how to install it."""
    return f"{what} is of weberlink-{guest}, which is not installed; install it with: {install_line(guest)}"


def install_line(extra: str) -> str:
    """The command that adds to this installation, to be typed in the present directory: an extra of the kernel, or a
    guest, which may have an extra too, such as "studies[dask]"."""
    is_guest = extra.partition("[")[0] in all_guests()
    clone, option = _clone()
    if clone is None:
        return f"{pip_install()} {quote(f'weberlink-{extra}' if is_guest else f'weberlink[{extra}]')}"
    where = "." if clone == Path.cwd() else str(clone)
    folders = [f"{where}/plugins/{each}" for each in _with_needed(extra)] if is_guest else [f"{where}[{extra}]"]
    return " ".join((pip_install(), *(f"{option}{quote(each)}" for each in folders)))


def _clone() -> tuple[Path | None, str]:
    """The clone that this program runs in, with the option of pip for that, or was installed from; None for a wheel."""
    package = Path(__file__).resolve().parent
    told = package.parent.glob("weberlink-*.dist-info/direct_url.json")  # by pip
    origins = (json.loads(path.read_text(encoding="utf-8"))["url"] for path in told)
    places = [(package.parents[1], "-e "), *((Path(unquote(urlsplit(url).path)), "") for url in origins)]
    return next((place for place in places if (place[0] / "pyproject.toml").is_file()), (None, ""))


def _with_needed(guest: str) -> list[str]:
    """The guests to install from a clone for this one: those that it depends on, which pip would look for on an index,
    then itself."""
    needed = guests(NEEDED).get(guest.partition("[")[0], "").split()
    return [*dict.fromkeys(each for other in needed for each in _with_needed(other)), guest]


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
