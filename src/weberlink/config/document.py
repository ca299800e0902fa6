"""Read the YAML document and apply overrides of the command line, without validating keys or values."""

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from weberlink.config.errors import STUCK, ConfigurationError, no_space
from weberlink.installation import config_folders


class _Loader(yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader):  # type: ignore[misc]
    """Refuses a key that is given twice, of which YAML would silently drop one, and one that holds its value."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue  # YAML itself refuses it
            problem = f"the key {key.value!r} is given twice" if key.value in seen else None
            if not key.style and (stuck := STUCK.match(key.value)) is not None:
                problem = no_space(stuck)
            if problem is not None:
                raise yaml.constructor.ConstructorError(None, None, problem, key.start_mark)
            seen.add(key.value)
        made: dict[Hashable, Any] = super().construct_mapping(node, deep)
        return made


def parse(path: Path) -> dict[str, Any]:
    """The mapping in a file; raises ConfigurationError if there is no such file, it is empty or holds no mapping, or a
    key is given twice."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: {_unreadable(path, error)}") from None
    try:
        content = yaml.load(text, Loader=_Loader)  # noqa: S506 - a SafeLoader with one more check
    except yaml.MarkedYAMLError as error:
        row, column, words = _mistake(text, error)
        raise ConfigurationError(f"{path}:{row + 1}:{column + 1}: not YAML: {words}") from None
    except yaml.YAMLError as error:
        raise ConfigurationError(f"{path}: not YAML: {error}") from None
    if content is None:
        raise ConfigurationError(f"{path}: is empty; start from a shipped file: weberlink configs")
    if not isinstance(content, dict):
        for number, line in enumerate(text.splitlines(), 1):
            if (stuck := STUCK.match(line)) is not None:
                raise ConfigurationError(f"{path}:{number}:{stuck.end() + 1}: not YAML: {no_space(stuck)}")
        raise ConfigurationError(f"{path}: must be a mapping with keys like link, codec, master, slave")
    return content


def _unreadable(path: Path, error: OSError | UnicodeDecodeError) -> str:
    match error:
        case FileNotFoundError():
            is_shipped = path.suffix == ".yaml" and any((each / path.name).is_file() for each in config_folders())
            return "no such file" + is_shipped * f"; weberlink configs {path.stem} copies the shipped one here"
        case IsADirectoryError():
            return "cannot be read: it is a folder; give the name of a file"
        case UnicodeDecodeError():
            return "cannot be read: it is not text; give a YAML file"
        case OSError():
            return f"cannot be read: {error.strerror}"


# What the commonest mistakes are, by what the parser says of them; {} is the character that it stops at.
_WORDS = {
    "mapping values are not allowed": 'a value holds ": " or a key; put the value in quotes, or begin a line',
    "could not find expected ':'": "expected key: value",
    "cannot start any token": "a value cannot begin with {}; put it in quotes",
    "found undefined alias": "a value cannot begin with {}; put it in quotes",
    "expected ',' or ']'": "a ] is missing",
    "expected ',' or '}'": "a }} is missing",
    "did not find expected key": "this line is indented by other spaces than those above",
    "found unexpected end of stream": "a quote is not closed",
    "found another document": "a second document begins here; a file holds one",
}


def _mistake(text: str, error: yaml.MarkedYAMLError) -> tuple[int, int, str]:
    """Line and column of a slip, from 0, and what it is; the parser sees much of it only in the line after it."""
    mark, problem = error.problem_mark or error.context_mark, str(error.problem)
    line, column = (0, 0) if mark is None else (mark.line, mark.column)
    lines = text.splitlines()
    before = next((at for at in range(min(line, len(lines)) - 1, -1, -1) if lines[at].strip(" \t")), line)
    for at in (each for each in (line, before) if each < len(lines)):
        indent = lines[at][: len(lines[at]) - len(lines[at].lstrip(" \t"))]
        if "\t" in indent:
            return at, indent.index("\t"), "a tab indents this line; use spaces"
    for at in (each for each in (before, line) if each < len(lines)):
        if (stuck := STUCK.match(lines[at])) is not None:
            return at, stuck.end(), no_space(stuck)
    if "expected ':'" in problem:
        line, column = before, 0
    found = lines[line][column : column + 1] if line < len(lines) else ""
    return line, column, next((words.format(found) for part, words in _WORDS.items() if part in problem), problem)


def override(content: dict[str, Any], text: str) -> str:
    """Apply one "path.to.key=value" in place, the value being YAML; returns the path. Raises ConfigurationError if it
    is not of that form, or the path leads through a value. With a `predictor`, the `bank` of the file is dropped, as it
    belongs to the predictor of the file."""
    name, equals, value = text.partition("=")
    keys = name.strip().split(".")
    if not equals or not all(keys):
        raise ConfigurationError(f"--set {text}: must be path.to.key=value")
    try:
        parsed = yaml.load(value, Loader=_Loader)  # noqa: S506
    except yaml.YAMLError as error:
        problem = _mistake(value, error)[2] if isinstance(error, yaml.MarkedYAMLError) else error
        raise ConfigurationError(f"--set {text}: the value is not YAML: {problem}") from None
    target: Any = content
    for depth, key in enumerate(keys):
        slot: Any = key
        if isinstance(target, list):
            if not (key.isdigit() and int(key) < len(target)):
                raise ConfigurationError(f"--set {text}: {'.'.join(keys[:depth])} has items 0 to {len(target) - 1}")
            slot = int(key)
        elif not isinstance(target, dict):
            raise ConfigurationError(f"--set {text}: {'.'.join(keys[:depth])} is a value and has no keys")
        if depth == len(keys) - 1:
            target[slot] = parsed
            if slot == "predictor":
                target.pop("bank", None)
        elif isinstance(target, dict) and target.get(slot) is None:
            target[slot] = {}
        target = target[slot]
    return ".".join(keys)
