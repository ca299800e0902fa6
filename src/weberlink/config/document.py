"""Read the YAML document and apply overrides of the command line, without validating keys or values."""

import re
from collections.abc import Hashable
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml

from weberlink.config.errors import STUCK, ConfigurationError, no_space
from weberlink.installation import config_folders


class _EachKeyOnce:
    """Refuses a key that is given twice, of which YAML would silently drop one, and one that holds its value."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue  # YAML itself refuses it
            if not key.style and (stuck := STUCK.match(key.value)) is not None:
                raise yaml.constructor.ConstructorError(None, None, no_space(stuck), key.start_mark)
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key {key.value!r} is given twice", key.start_mark
                )
            seen.add(key.value)
        made: dict[Hashable, Any] = super().construct_mapping(node, deep)  # type: ignore[misc]
        return made


class _Loader(_EachKeyOnce, yaml.SafeLoader):
    """Gives the better error messages."""


if yaml.__with_libyaml__:

    class _QuickLoader(_EachKeyOnce, yaml.CSafeLoader):
        """Ten times as fast, which shortens the start of a daemon."""


_QUICKEST: Any = _QuickLoader if yaml.__with_libyaml__ else _Loader


def _read(text: str) -> Any:
    """Parse YAML; raises YAMLError."""
    if yaml.__with_libyaml__:
        with suppress(yaml.YAMLError):
            return yaml.load(text, Loader=_QuickLoader)  # noqa: S506 - a SafeLoader with one more check
    return yaml.load(text, Loader=_Loader)  # noqa: S506


LONGEST_FOREIGN = 1 << 16
"""Characters of a configuration in a file that anybody may have made; those of all shipped files have 5,000."""
DEEPEST_FOREIGN = 32


def parse_foreign(text: str) -> Any:
    """The YAML in a file that anybody may have made; raises ValueError if it is none, or longer than `LONGEST_FOREIGN`,
    deeper than `DEEPEST_FOREIGN`, or has aliases, by which a short text stands for a long one; in one line.
    """
    if len(text) > LONGEST_FOREIGN:
        raise ValueError(f"more than {LONGEST_FOREIGN} characters")
    depth = 0
    try:
        for event in yaml.parse(text, Loader=_QUICKEST):
            if isinstance(event, yaml.AliasEvent):
                raise ValueError("YAML with an alias")  # noqa: TRY004
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > DEEPEST_FOREIGN:
                raise ValueError(f"YAML that is nested more than {DEEPEST_FOREIGN} deep")
        return yaml.load(text, Loader=_QUICKEST)  # noqa: S506 - a SafeLoader with one more check
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).split())) from None


def parse(path: Path) -> dict[str, Any]:
    """The mapping in a file; raises ConfigurationError if there is no such file, it is empty or holds no mapping, or a
    key is given twice.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: {_unreadable(path, error)}") from None
    try:
        content = _read(text)
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


_WORDS = (
    (r"mapping values are not allowed here", 'a value holds ": " or a key; put the value in quotes, or begin a line'),
    (r"could not find expected ':'", "expected key: value"),
    (r"found character '(.)' that cannot start any token", r"a value cannot begin with \1; put it in quotes"),
    (r"found undefined alias '(.*)'", r"a value cannot begin with *; put it in quotes"),
    (r"expected ',' or '([]}])', but .*", r"a \1 is missing"),
    (r"expected <block end>, but found .*", "this line is indented by other spaces than those above"),
    (r"found unexpected end of stream", "a quote is not closed"),
    (r"but found another document", "a second document begins here; a file holds one"),
)
"""What the commonest mistakes are, by the parser's words for them."""


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
    words = (re.sub(pattern, word, problem) for pattern, word in _WORDS if re.fullmatch(pattern, problem))
    return line, column, next(words, problem)


def override(content: dict[str, Any], text: str) -> str:
    """Apply one "path.to.key=value" in place, the value being YAML; returns the path.

    With a `predictor`, the `bank` of the file is dropped, as it belongs to the predictor of the file.

    Raises:
        ConfigurationError: it is not of that form, or the path leads through a value.
    """
    name, equals, value = text.partition("=")
    keys = name.strip().split(".")
    if not equals or not all(keys):
        raise ConfigurationError(f"--set {text}: must be path.to.key=value")
    try:
        parsed = _read(value)
    except yaml.YAMLError as error:
        problem = _mistake(value, error)[2] if isinstance(error, yaml.MarkedYAMLError) else error
        raise ConfigurationError(f"--set {text}: the value is not YAML: {problem}") from None
    target: Any = content
    for depth, key in enumerate(keys):
        last = depth == len(keys) - 1
        if isinstance(target, list):
            if not (key.isdigit() and int(key) < len(target)):
                raise ConfigurationError(f"--set {text}: {'.'.join(keys[:depth])} has items 0 to {len(target) - 1}")
            slot: Any = int(key)
        elif isinstance(target, dict):
            slot = key
            if target.get(slot) is None and not last:
                target[slot] = {}
        else:
            raise ConfigurationError(f"--set {text}: {'.'.join(keys[:depth])} is a value and has no keys")
        if last:
            target[slot] = parsed
            if slot == "predictor":
                target.pop("bank", None)
        else:
            target = target[slot]
    return ".".join(keys)
