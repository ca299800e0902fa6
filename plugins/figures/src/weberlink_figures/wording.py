"""Plain words and level of each event of a session, for its log file and for the page."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from weberlink.config import MASTER, SLAVE
from weberlink.protocol.paths import LinkPath, path_in
from weberlink_figures.tree import DEGRADED, GOOD

INFO, WARN, ALARM = "info", "warn", "alarm"
"""Levels of an event: all is well; worth a look; the session does not do its work."""

Fields = Mapping[str, Any]


def class_words(path: LinkPath, sent: int | None) -> str:
    """What came of the class of service that was asked for (`link.dscp`); "" while unknown."""
    if path.dscp is None:
        return ""
    return f"DSCP {path.dscp}" if path.dscp == sent or sent is None else f"DSCP {sent} came as {path.dscp}"


class Words(NamedTuple):
    """Level of an event, and its text."""

    level: str
    text: str


FAULTS = {
    "silence": Words(ALARM, "hears nothing from the {peer}: the force is zero and the robot holds"),
    "unheard": Words(ALARM, "hears the {peer}, which does not hear this side: the force is zero and the robot holds"),
    "undelivered": Words(
        ALARM, "updates of one direction do not come through, although this side and the {peer} hear each other"
    ),
    "undelivered_second": Words(
        ALARM,
        "updates of the tool's rotation or of the gripper do not come through in one direction, although this side and "
        "the {peer} hear each other",
    ),
    "device": Words(ALARM, "its {hardware} gives no usable sample: this side leaves the session"),
    "refused": Words(ALARM, "the {peer} runs another configuration or version: no session"),
    "update": Words(WARN, "an update from the {peer} does not fit the channel: it was not applied"),
    "stalled": Words(ALARM, "the process stood still for longer than the limit"),
    "taken_over": Words(ALARM, "another master has taken over the robot: this one leaves"),
    "unproven": Words(ALARM, "a message of the {peer} did not prove the key: are the keys the same on both hosts?"),
    "unfounded": Words(ALARM, "a force was asked for that the {peer} states no contact for: it was faded out"),
    "tripped": Words(ALARM, "the contact force passed its limit: the robot backed off and waits for the hand"),
}
"""What each fault means; `{peer}` is the other side, `{hardware}` the device or the robot of this one."""

STATES = {
    "idle": Words(INFO, "idle"),
    "connecting": Words(INFO, "calls the {peer}"),
    "listening": Words(INFO, "waits for a call of the {peer}"),
    "engaged": Words(INFO, "engaged: in a session with the {peer}"),
    "silent": Words(WARN, "silent: nothing is known to get through to the {peer} and back"),
    "closed": Words(INFO, "closed"),
}


def words(side: str, event: str, fields: Fields) -> Words:
    """The words for an event of `weberlink_figures.journal`; those of an unknown event are its name."""
    if event in STATES:
        return _of_side(STATES[event], side)
    made = EVENTS.get(event)
    return Words(INFO, event) if made is None else made(side, fields)


def fault_words(side: str, fault: str) -> Words:
    """The words for a fault, by its name in lower case."""
    return _of_side(FAULTS.get(fault, Words(ALARM, fault)), side)


def _of_side(template: Words, side: str) -> Words:
    peer, hardware = (SLAVE, "device") if side == MASTER else (MASTER, "robot")
    return template._replace(text=template.text.format(peer=peer, hardware=hardware))


def _ended(_side: str, fields: Fields) -> Words:
    outcome, judged = fields["outcome"], fields.get("verdict")
    if judged is None:
        is_good = outcome == "completed" or fields.get("status") == 0
        return Words(INFO if is_good else ALARM, f"the session ended: {outcome}")
    causes = "; ".join(cause["text"] for cause in judged["causes"])
    told = f"{judged['word']} because {causes}" if causes else judged["word"]
    level = {GOOD: INFO, DEGRADED: WARN}.get(judged["word"], ALARM)
    return Words(level, f"the session ended ({outcome}): {told}")


def _peer(side: str, fields: Fields) -> Words:
    other = SLAVE if side == MASTER else MASTER
    name = f"the {other} {fields['name']}" if "name" in fields else f"a {other}"
    key = f", with key {fields['key']} to {fields.get('right')}" if "key" in fields else ""
    if "refusal" in fields:
        return Words(WARN, f"{name}{key}: refused: {fields['refusal']}")
    left = f" left: {fields['farewell']}" if "farewell" in fields else " is the peer"
    return Words(INFO, f"{name}{key}{left}")


def _counted(level: str, what: str) -> Callable[[str, Fields], Words]:
    return lambda _, fields: Words(level, f"{fields['ticks']} tick{'s' * (fields['ticks'] != 1)} {what}")


EVENTS: dict[str, Callable[[str, Fields], Words]] = {
    "started": lambda side, fields: Words(
        INFO, f"began at {fields['rate_hz']:g} Hz; {words(side, fields['state'], {}).text}"
    ),
    "fault": lambda side, fields: fault_words(side, fields["fault"]),
    "recovered": lambda _, fields: Words(INFO, f"the fault {fields['fault']} is over after {fields['lasted_s']:.3g} s"),
    "settings": lambda _, fields: Words(
        INFO, f"settings changed, change {fields['generation']}: Weber factor {fields['weber']:g}"
    ),
    "peer": _peer,
    "path": lambda _, fields: Words(WARN if fields["changes"] else INFO, path_in(fields).words()),
    "held": lambda *_: Words(INFO, "button held: the robot follows"),
    "released": lambda *_: Words(WARN, "button released: the robot holds and the force is zero"),
    "missed": _counted(WARN, "missed"),
    "clipped": _counted(WARN, "with a limited output"),
    "slewed": _counted(INFO, "in which the slew limit held the force back"),
    "pressed": _counted(WARN, "in which the limit of the contact force held the robot back"),
    "trace": lambda _, fields: Words(ALARM, ": ".join(line.strip() for line in fields["entry"].splitlines()[:2])),
    "summary": lambda _, fields: Words(INFO, f"figures of the last {fields['interval_s']:g} s"),
    "ended": _ended,
}
