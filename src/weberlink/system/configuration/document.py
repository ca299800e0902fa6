"""Read the YAML document and apply overrides of the command line, without validating keys or values."""

from collections.abc import Hashable
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml

from weberlink.system.configuration.errors import ConfigurationError


class _EachKeyOnce:
    """Refuses a key that is given twice, of which YAML would silently drop one."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue  # YAML itself refuses it
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


def _read(text: str) -> Any:
    """Parse YAML; raises YAMLError."""
    if yaml.__with_libyaml__:
        with suppress(yaml.YAMLError):
            return yaml.load(text, Loader=_QuickLoader)  # noqa: S506 - a SafeLoader with one more check
    return yaml.load(text, Loader=_Loader)  # noqa: S506


def parse(path: Path) -> dict[str, Any]:
    """The mapping in a file.

    Raises:
        ConfigurationError: there is no such file, it is empty or holds no mapping, or a key is given twice.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigurationError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise ConfigurationError(f"{path}: cannot be read: it is a folder; give the name of a file") from None
    except UnicodeDecodeError:
        raise ConfigurationError(f"{path}: cannot be read: it is not text; give a YAML file") from None
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from None
    try:
        content = _read(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        at = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise ConfigurationError(f"{path}{at}: not YAML: {error.problem}") from None
    except yaml.YAMLError as error:
        raise ConfigurationError(f"{path}: not YAML: {error}") from None
    if content is None:
        raise ConfigurationError(f"{path}: is empty; start from one of the files of configs/")
    if not isinstance(content, dict):
        raise ConfigurationError(f"{path}: must be a mapping with keys like link, codec, master, slave")
    return content


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
        problem = error.problem if isinstance(error, yaml.MarkedYAMLError) else error
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
