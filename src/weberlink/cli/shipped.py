"""The files that come with the program: what there is, and copies of them with the files that they name."""

import re
from collections.abc import Iterator
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from weberlink.config import ConfigurationError
from weberlink.installation import CONFIGS, absence, config_folders, config_modules, guests
from weberlink.session.targets import TargetError, check_file

SCHEMA = "weberlink.schema.json"
OTHERS = {
    "49-weberlink.rules": "udev rules; weberlink device rules installs them, and those of guests",
    "plotjuggler-layout.xml": "layout of PlotJuggler for an exported recording",
    "systemd/": "units of master and slave",
    "traces/": "a recorded motion",
    SCHEMA: "schema of configuration files, for editors",
}
"""What is no configuration: files and folders, and what they are for; guests say it in the package of theirs."""
SHORTEST, LONGEST = 30, 100  # characters of a sentence that says enough alone, and of one that is cut at its colon


def listing() -> list[tuple[str, str]]:
    """All shipped files, each with a sentence: configurations first."""
    found = sorted((path for folder in config_folders() for path in folder.glob("*.yaml")), key=lambda path: path.stem)
    configurations = [(path.stem, _about(path)) for path in found]
    others = {
        name: about
        for module in config_modules()
        for name, about in vars(import_module(module)).get("OTHERS", {}).items()
    }
    return [*configurations, *sorted((OTHERS | others).items())]


def show(console: Console) -> None:
    table = Table("", "", box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
    table.columns[0].no_wrap = True
    for name, about in listing():
        table.add_row(Text(name), Text(about))
    console.print(table)
    console.print(Text("weberlink configs NAME copies one here, with the files that it names."))


def _about(path: Path) -> str:
    """The first sentence of the comment that a configuration begins with; two of them where it is short."""
    lines = path.read_text(encoding="utf-8").splitlines()
    comment = " ".join(
        line.lstrip("# ") for line in lines[: next(i for i, text in enumerate(lines) if text[:1] != "#")]
    )
    sentences = re.split(r"(?<=\.) (?=[A-Z`])", re.sub(r"^yaml-language-server: \S+ ", "", comment))
    about = sentences[0] if len(sentences[0]) >= SHORTEST else " ".join(sentences[:2])
    return (about.partition(": ")[0] if len(about) > LONGEST else about).rstrip(":.")


def find(name: str) -> Path:
    """A shipped file or folder by its name; a configuration also without `.yaml`. Raises ConfigurationError if there is
    none."""
    asked = name.removeprefix("configs/")
    known: dict[str, Path] = {}
    for folder in config_folders():
        for path in _all(folder):
            place = str(path.relative_to(folder))
            known |= {place: path, f"{place}/" if path.is_dir() else place.removesuffix(".yaml"): path}
    if asked in known:
        return known[asked]
    guest = guests(CONFIGS).get(asked.removesuffix(".yaml").removesuffix("/"))
    if guest is not None:
        raise ConfigurationError(absence(asked, guest))
    nearest = get_close_matches(asked, known, n=1)
    meant = f"did you mean {nearest[0]}? " if nearest else ""
    raise ConfigurationError(f"{name}: there is no such shipped file; {meant}weberlink configs lists them")


def _all(folder: Path) -> Iterator[Path]:
    """Files and folders, without what Python itself makes of the folder."""
    for path in folder.rglob("*"):
        if path.name != "__pycache__" and path.suffix not in (".py", ".pyc"):
            yield path


def text_of(name: str) -> str:
    """A shipped file as text; raises ConfigurationError if there is none, or it is a folder or no text."""
    path = find(name)
    if path.is_dir():
        raise ConfigurationError(f"{name}: is a folder; name one of its files")
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ConfigurationError(f"{name}: is no text; copy it to a file") from None


def copy(name: str, out: Path | None) -> list[Path]:
    """Copy a shipped file with the files that it names, each at the same place beside it; or a folder.

    A file that is there already with the same content stays. No other one is overwritten, and then nothing is written.
    `out` is the copy, or a folder for it; None for the same name in the working directory. Returns what was written;
    raises ConfigurationError if there is no such file, or a copy cannot be written.
    """
    source = find(name)
    target = Path(source.name) if out is None else out / source.name if out.is_dir() else out
    if source.is_dir():
        pairs = {path: target / path.relative_to(source) for path in _all(source) if path.is_file()}
    else:
        pairs, folders = {source: target}, (source.parent, *config_folders())
        for path in needed_by(source):
            folder = next(each for each in folders if each in path.parents)
            pairs[path] = target.parent / path.relative_to(folder)
    new = {path: place for path, place in pairs.items() if not place.exists()}
    for path, place in pairs.items():
        if path not in new and not (place.is_file() and place.read_bytes() == path.read_bytes()):
            raise ConfigurationError(f"{place}: exists and is another one; name another file or folder with --out")
    try:
        if new and source.is_file():
            check_file(target)
        for path, place in new.items():
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(path.read_bytes())
            place.chmod(path.stat().st_mode | 0o200)
    except TargetError as error:
        raise ConfigurationError(str(error)) from None
    except OSError as error:
        raise ConfigurationError(f"{error.filename}: cannot be written: {error.strerror}") from None
    return list(new.values())


def needed_by(path: Path) -> list[Path]:
    """The files that a YAML or XML file names, and those that these name in turn: beside it, or of the program."""
    found: list[Path] = []
    waiting = [path]
    while waiting:
        at = waiting.pop()
        text = at.read_text(encoding="utf-8") if at.suffix in (".yaml", ".xml") else ""
        text = re.sub(r"(?m)(^|\s)#(?! yaml-language-server).*", "", text)  # that comment names the schema
        for name in re.split(r"[\s\"'=<>\[\]{},]+", text):
            near = (at.parent / name).resolve()
            near = near if near.is_file() else config_folders()[0] / name
            if near.is_file() and near not in (path.resolve(), *found):
                found.append(near)
                waiting.append(near)
    return found
