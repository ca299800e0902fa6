"""What a flood must not do, and its figures in one line. Pure."""

from collections.abc import Mapping
from math import inf
from typing import Any

LIVES = 0.999
"""Share of the ticks of a flood that must be in the session."""
STALL_S = 0.1
"""Without a tick for so long, the machine stood still, and a lost session is not the flood's."""
MUCH = 3.0
"""Times what a daemon sends without a flood: what it feels meanwhile varies."""
PROVEN = "calls"
"""The kind of datagrams that hold a proof of the key, and may be answered."""


def line(figures: Mapping[str, Any]) -> str:
    """One flood in one line, of the side that it was aimed at; before, during and after."""
    target, shots = figures["target"], figures["shots"]
    before, during, after = (figures[name] for name in ("before", "during", "after"))
    core = " -> ".join(f"{100 * phase['core'][target]:.1f}" for phase in (before, during, after))
    missed = " -> ".join(f"{100 * phase['missed'][target]:.2f}" for phase in (before, during))
    late = " -> ".join(f"{phase['lateness_p99_us'].get(target, 0):.0f}" for phase in (before, during))
    felt = " -> ".join(_share(phase["violations"]) for phase in (before, during))
    engaged = "/".join(f"{100 * share:.1f}" for share in during["engaged"].values())
    answers = "unheard" if shots["answers"] is None else f"{shots['answers']} answers {shots['answered_bytes']} B"
    return (
        f"{figures['kind']:10} at the {target:6} from {figures['source']:7} {shots['sent'] / shots['seconds']:7.0f}/s: "
        f"core {core} %, missed {missed} %, late p99 {late} us, engaged {engaged} %, calls {figures['calls']}, "
        f"felt outside {felt}, refused {during['dropped'].get(target)}, "
        f"kernel dropped {during['kernel_drops'][target]}, {answers}"
    )


def _share(share: float | None) -> str:
    return "none" if share is None else f"{100 * share:.1f} %"


def violated(figures: Mapping[str, Any], most_core: float = inf, most_missed: float = inf) -> list[str]:
    """What a flood has done that it must not.

    Args:
        figures: of `flood`.
        most_core: share of a core that the flooded daemon may take.
        most_missed: share of ticks that it may miss.
    """
    target, during = figures["target"], figures["during"]
    found = _ended(figures) + _answered(figures) + _sent(figures)
    if during["core"][target] > most_core:
        taken = f"{100 * during['core'][target]:.0f} % of a core"
        found.append(f"the {target} took {taken}, more than {100 * most_core:.0f} %")
    if during["missed"][target] > most_missed:
        found.append(f"the {target} missed {100 * during['missed'][target]:.2f} % of its ticks")
    return found


def _ended(figures: Mapping[str, Any]) -> list[str]:
    found = []
    for name, words in (("during", "of the flood"), ("after", "of the time afterwards")):
        phase = figures[name]
        if phase["stall_s"] >= STALL_S:
            continue
        found += [
            f"the {side} was in the session for {100 * share:.2f} % {words}"
            for side, share in phase["engaged"].items()
            if share < LIVES
        ]
    return found


def _answered(figures: Mapping[str, Any]) -> list[str]:
    """No more is answered than was asked, one answer to a question, and none to who has not proved the key."""
    shots = figures["shots"]
    if not shots["answers"]:  # none, or nobody could hear them
        return []
    found = []
    if figures["kind"] != PROVEN:
        found.append(f"{shots['answers']} answers to who has not proved the key")
    if shots["answers"] > shots["sent"] or shots["answered_bytes"] > shots["sent_bytes"]:
        asked = f"{shots['sent']} questions of {shots['sent_bytes']} B"
        found.append(f"{asked} had {shots['answers']} answers of {shots['answered_bytes']} B")
    if shots["longest_answer"] > shots["shortest_question"]:
        found.append(f"an answer of {shots['longest_answer']} B, a question of {shots['shortest_question']} B")
    return found


def _sent(figures: Mapping[str, Any]) -> list[str]:
    """What goes to a spoofed address cannot be heard, but the daemon counts it."""
    target, before, during = figures["target"], figures["before"], figures["during"]
    usual = before["sent_bytes"].get(target, 0) / before["seconds"] * during["seconds"]
    sent = during["sent_bytes"].get(target, 0)
    if sent <= MUCH * usual + figures["shots"]["sent_bytes"]:
        return []
    return [f"the {target} sent {sent} B, {usual:.0f} B without a flood"]
