"""Paths that fail while a hand presses on a remote surface."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import monotonic, sleep
from typing import Any

import numpy as np

from tests.anywhere.hosts import ENGAGED, FILE, Command, within
from tests.anywhere.interruption import EITHER, NOTHING, SILENCE, Interruption, measure, violated
from tests.anywhere.scene import MEET_S, SCRIPT, Scene, last_line, scene, waits
from tests.anywhere.testbed import CONE, FIRST, SECOND, SYMMETRIC
from weberlink.system.configuration import MASTER, SLAVE, load

BACK_S = 30.0
"""From the end of a fault until a session [s]."""
CONTACT_N = 0.3


@dataclass(frozen=True)
class Fault:
    """What fails, for `lasts` [s].

    Args:
        begin, end: do it and undo it.
        effect: what it must lead to.
        robot, operator: kinds of NAT.
        second: kind of NAT of the operator's second interface.
        arguments: of both commands.
        after_s: from the end of the fault until what it did is looked at, if the session lasts.
    """

    meaning: str
    begin: Callable[[Scene], object]
    end: Callable[[Scene], object] = lambda _: None
    lasts: float = 0.0
    effect: str = SILENCE
    robot: str = CONE
    operator: str = CONE
    second: str | None = None
    arguments: tuple[str, ...] = ()
    after_s: float = 3.0


def first(place: Scene) -> Any:
    return place.operator.home.first


TWO = ("--set", "link.paths=2", "--set", f"link.interfaces=[{FIRST},{SECOND}]")
FAULTS: Mapping[str, Fault] = {
    "cut": Fault(
        "operator's interface down", lambda s: first(s).unplug(), lambda s: first(s).connect_host(), lasts=2.0
    ),
    "cut-robot": Fault(
        "robot's interface down",
        lambda s: s.robot.home.first.unplug(),
        lambda s: s.robot.home.first.connect_host(),
        lasts=2.0,
    ),
    "cut-one": Fault(
        "one interface of two down",
        lambda s: first(s).unplug(),
        lambda s: first(s).connect_host(),
        lasts=2.0,
        effect=NOTHING,
        second=CONE,
        arguments=TWO,
    ),
    "moved": Fault(
        "Wi-Fi down, phone stays (1 path)",
        lambda s: first(s).unplug(),
        second=CONE,
        arguments=("--set", "link.paths=1"),
    ),
    "dark": Fault(
        "router passes nothing", lambda s: first(s).set_silent(True), lambda s: first(s).set_silent(False), lasts=2.0
    ),
    "blink": Fault(
        "the same, for 50 ms",
        lambda s: first(s).set_silent(True),
        lambda s: first(s).set_silent(False),
        lasts=0.05,
        effect=EITHER,
    ),
    "forget": Fault("cone NAT loses its mappings", lambda s: first(s).forget(), effect=EITHER),
    "forget-relay": Fault(
        "symmetric NAT loses its mappings",
        lambda s: first(s).forget(),
        robot=SYMMETRIC,
        operator=SYMMETRIC,
        effect=EITHER,
    ),
    "timeout": Fault("unused mappings live for 1 s", lambda s: first(s).set_timeout(1), lasts=4.0, effect=NOTHING),
    "address": Fault("operator's address changes", lambda s: first(s).readdress(), effect=EITHER),
    "renumber": Fault("router's address changes", lambda s: first(s).renumber(), effect=EITHER),
    "relay": Fault(
        "relay killed and restarted",
        lambda s: s.relay.stop(),
        lambda s: s.relay.start(),
        lasts=2.0,
        robot=SYMMETRIC,
        operator=SYMMETRIC,
    ),
    "mailbox": Fault(
        "mailbox gone", lambda s: s.mailbox.stop(), lambda s: s.mailbox.start(), lasts=5.0, effect=NOTHING
    ),
}


def inflict(fault: Fault) -> tuple[Interruption | None, list[str]]:
    """Start a session, wait for contact, do the fault and undo it; the figures, and what was broken."""
    with (
        scene(fault.robot, fault.operator, second=fault.second) as place,
        place.robot.command(SLAVE, *fault.arguments) as robot,
    ):
        if not waits(robot):
            return None, [f"no slave: {last_line(robot.said)}"]
        with place.operator.command(MASTER, *fault.arguments, "--set", SCRIPT) as operator:
            if operator.first_engaged(MEET_S) is None:
                return None, [f"no session: {last_line(operator.said)}"]
            if within(MEET_S, lambda: is_in_contact(operator)) is None:
                return None, ["no contact"]
            failed = monotonic()
            fault.begin(place)
            sleep(fault.lasts)
            fault.end(place)
            restored = monotonic()
            within(BACK_S, lambda: monotonic() > restored + fault.after_s and are_engaged(operator, robot))
            sleep(1.0)
            loaded = load(place.operator.folder / FILE, (*fault.arguments[1::2], SCRIPT), [MASTER])
            found = measure(operator.records, robot.records, failed, restored, loaded)
            return found, violated(found, loaded, fault.effect)


def is_in_contact(operator: Command) -> bool:
    """Whether there was force on the hand for the last 0.3 s, in a session."""
    last = operator.records[-300:]
    forces = np.linalg.norm(last["output"], axis=1)
    return len(last) == 300 and bool((forces > CONTACT_N).all() and (last["state"] == ENGAGED).all())


def are_engaged(*commands: Command) -> bool:
    return all(len(command.records) and command.records["state"][-1] == ENGAGED for command in commands)
