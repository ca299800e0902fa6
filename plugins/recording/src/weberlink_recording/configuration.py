"""The facts of a recording: what they are made of, and the configuration in a file that anybody may have made."""

import json
from collections.abc import Mapping
from typing import Any

import yaml

from weberlink.protocol.states import State
from weberlink.session.description import RANGE
from weberlink.telemetry.fault import Fault
from weberlink_figures.channel import joints_in
from weberlink_figures.environment import environment

LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
LONGEST_FOREIGN = 1 << 16  # characters of it; those of all shipped files have 5,000
DEEPEST_FOREIGN = 32
CONFIGURATION = "configuration"  # the fact with the configuration, as YAML
TORQUE_BANK = "torque_bank"  # that with the predictors of the torque channel; absent with three degrees of freedom
BEGUN, DURING = "begun", "during the session"
"""That of a recording which leaves out the beginning of its session, so that counters do not start at 0."""


def facts_of(described: Mapping[str, Any], *, virtual: bool = False) -> dict[str, str]:
    """What is said of a session, as of `weberlink.telemetry.recorders`, and the names of numbers in the records."""
    torque = described.get(TORQUE_BANK)
    return {
        CONFIGURATION: yaml.safe_dump(dict(described["system"]), sort_keys=False),
        "bank": " ".join(described["bank"]),
        **({} if torque is None else {TORQUE_BANK: " ".join(torque)}),
        "states": " ".join(f"{state.value}={state.name.lower()}" for state in State),
        "faults": " ".join(f"{fault.value}={fault.name.lower()}" for fault in Fault),
        "clock": "virtual" if virtual else "real",
        "environment": json.dumps(environment()),
        **{name: " ".join(map(str, described[name])) for name in RANGE if name in described},
    }


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
