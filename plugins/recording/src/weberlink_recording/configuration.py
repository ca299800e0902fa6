"""The configuration in a file that anybody may have made."""

from collections.abc import Mapping
from typing import Any

import yaml

from weberlink_figures.channel import joints_in

LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
LONGEST_FOREIGN = 1 << 16  # characters of it; those of all shipped files have 5,000
DEEPEST_FOREIGN = 32
CONFIGURATION = "configuration"  # the fact with the configuration, as YAML


def parse_foreign(text: str) -> Any:
    """The YAML in a file that anybody may have made; raises ValueError if it is none, or longer than `LONGEST_FOREIGN`,
    deeper than `DEEPEST_FOREIGN`, or has aliases, by which a short text stands for a long one; in one line.
    """
    if len(text) > LONGEST_FOREIGN:
        raise ValueError(f"more than {LONGEST_FOREIGN} characters")
    depth = 0
    try:
        for event in yaml.parse(text, Loader=LOADER):
            if isinstance(event, yaml.AliasEvent):
                raise ValueError("YAML with an alias")  # noqa: TRY004
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > DEEPEST_FOREIGN:
                raise ValueError(f"YAML that is nested more than {DEEPEST_FOREIGN} deep")
        return yaml.load(text, Loader=LOADER)  # noqa: S506 - a SafeLoader
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).split())) from None


def joints_of(facts: Mapping[str, str]) -> tuple[str, ...]:
    """The axes of a session in joint space, the gripper last; none of a hand, or where the facts do not tell."""
    try:
        return joints_in(parse_foreign(facts[CONFIGURATION]))
    except (KeyError, ValueError):
        return ()
