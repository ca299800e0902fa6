"""Two hosts pair through a real mailbox server, among attacks by it and by third parties."""

import json
import subprocess
import sys
from typing import Any

import pytest

from tests.program import ROOT

for package in ("wormhole", "wormhole_mailbox_server", "websockets"):
    pytest.importorskip(package)

PATIENCE = 300.0
"""Until the program counts as hung [s]."""
VOID = "a wrong code, or a message changed on the way"
SILENT = "the other host stopped answering"
EITHER = f"{VOID}|{SILENT}"
"""The first to find the change closes, perhaps before the other one has a message to find it in."""
GONE = "nobody waits with the code|was used already"
NOBODY = "nobody joined"
PAIRED = {"slave": "paired", "master": "paired"}
CASES = {
    "honest": PAIRED,
    "shuffled": PAIRED,
    "odd names": PAIRED,
    "wrong code": {"slave": VOID, "master": VOID},
    "third party first": {"slave": VOID, "thief": VOID, "master": GONE},
    "third party between": {"slave": NOBODY, "master": GONE, "thief": GONE},
    "code used twice": {"thief": GONE},
    "changed 0 slave": {"slave": VOID, "master": SILENT},
    "drop 1 slave": {"slave": SILENT, "master": SILENT},
    "recorded": {"second slave": VOID},
    "known already": {"slave again": "weberlink peer", "master again": "weberlink peer"},
}
"""How each trial ends for whom."""
EXPLORED = {
    "twice": PAIRED,
    "server restarted": PAIRED,
    "crossed": {"other slave": VOID, "master": VOID},
    "two slaves": {"slave": "the same side", "master": "the same side"},
    "drop pake slave": {"slave": NOBODY, "master": SILENT},
    "drop 0 both": {"slave": SILENT, "master": SILENT},
    "drop 2 both": {"slave": f"{SILENT} before its 'kept'", "master": f"{SILENT} before its 'kept'"},
    "drop 2 master": {"master": "remove this host there"},
    "changed pake slave": {"slave": "sent what is no message of a pairing", "master": SILENT},
    "changed version master": {"slave": SILENT, "master": VOID},
    "changed 1 master": {"slave": SILENT, "master": VOID},
    "changed 2 slave": {"slave": VOID},
    "reflected pake both": {"slave": "ReflectionThwarted", "master": GONE},
    "reflected 0 master": {"slave": SILENT, "master": EITHER},
    "foreign 0 slave": {"slave": VOID, "master": SILENT},
    "renumbered 0 both": {"slave": EITHER, "master": EITHER},
    "renumbered 1 both": {"slave": EITHER, "master": EITHER},
    "mute": {"slave": "does not answer"},
    "unwelcome": {"slave": "refused: no weberlink[2J here"},
}
"""The same, with `--hunt`."""
RULES = ("drop", "changed", "reflected", "foreign")
EVERY = [f"{rule} {phase} {to}" for rule in RULES for phase in ("pake", "version", "0", "1", "2") for to in (
    "slave", "master", "both"
)]  # fmt: skip


def pairings(trials: list[str], patience: float) -> Any:
    command = [sys.executable, "-m", "tests.anywhere.pairings", ",".join(trials), "--patience", str(patience)]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return json.loads(ended.stdout)


def judged(cases: dict[str, dict[str, str]]) -> None:
    found = pairings([name for name in cases if name != "honest"], 2.0)

    def others() -> list[str]:
        return [
            name
            for name, ends in cases.items()
            if not all(any(one in found["ends"][name][who] for one in why.split("|")) for who, why in ends.items())
        ]

    if late := others():  # with the patience of a machine that is busy
        again = pairings(late, 15.0)
        found["ends"] |= again["ends"]
        found["unsound"] += again["unsound"]
    assert {name: found["ends"][name] for name in others()} == {}
    assert found["unsound"] == [], "what a host holds is not what it paired with"
    assert found["learnt"] == [], "the mailbox learns neither key nor names"


def test_hosts_pair_or_refuse_with_the_reason() -> None:
    judged(CASES)


@pytest.mark.hunt
def test_other_attacks_end_with_their_reason() -> None:
    judged(EXPLORED)


@pytest.mark.hunt
def test_no_change_of_any_message_leaves_a_foreign_peer() -> None:
    assert pairings(EVERY, 3.0)["unsound"] == []
