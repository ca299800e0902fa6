"""Two hosts pair through a real mailbox server, among attacks by it and by third parties."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

for package in ("wormhole", "wormhole_mailbox_server", "websockets"):
    pytest.importorskip(package)

ROOT = Path(__file__).parents[2]
PATIENCE = 300.0
"""Until the program counts as hung [s]."""


def pairings(*arguments: str) -> Any:
    command = [sys.executable, "-m", "tests.anywhere.pairings", *arguments]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return json.loads(ended.stdout)


VOID = "a wrong code, or a message changed on the way"
SILENT = "the other host stopped answering"
TOLD = f"the other host refused: {SILENT}"
EITHER = f"{VOID}|{SILENT}"
"""The first to find the change closes, perhaps before the other one has a message to find it in."""
GONE = "nobody waits with the code"
NOBODY = "nobody joined"
NOT_OURS = "sent what is no message of a pairing"
CASES = {
    "wrong code": {"slave": VOID, "master": VOID},
    "third party first": {"slave": VOID, "thief": VOID, "master": GONE},
    "crossed": {"other slave": VOID, "master": VOID},
    "drop pake slave": {"slave": NOBODY, "master": SILENT},
    "drop 0 both": {"slave": SILENT, "master": SILENT},
    "drop 1 slave": {"slave": SILENT, "master": TOLD},
    "drop 2 both": {"slave": f"{SILENT} before its 'kept'", "master": f"{SILENT} before its 'kept'"},
    "drop 2 master": {"master": "remove this host there"},
    "changed pake slave": {"slave": NOT_OURS, "master": SILENT},
    "changed version master": {"slave": SILENT, "master": VOID},
    "changed 0 slave": {"slave": VOID, "master": SILENT},
    "changed 1 master": {"slave": SILENT, "master": VOID},
    "changed 2 slave": {"slave": VOID},
    "reflected pake both": {"slave": "ReflectionThwarted", "master": GONE},
    "reflected 0 master": {"slave": SILENT, "master": EITHER},
    "foreign 0 slave": {"slave": VOID, "master": SILENT},
    "renumbered 0 both": {"slave": EITHER, "master": EITHER},
    "renumbered 1 both": {"slave": EITHER, "master": EITHER},
    "third party between": {"slave": NOBODY, "master": GONE},
    "recorded": {"second slave": VOID},
    "mute": {"slave": "does not answer"},
    "garbage": {"slave": "does not answer"},
    "unwelcome": {"slave": "refused: no weberlink[2J here"},
    "known already": {"slave again": "weberlink peer", "master again": "weberlink peer"},
    "two slaves": {"slave": "the same side", "master": "the same side"},
}
ESSENTIAL = ("wrong code", "third party first", "changed 0 slave", "drop 1 slave", "recorded", "known already")
"""Trials of every run of the suite; the others explore."""
PAIRED = ("honest", "shuffled")
ALONE = {"code used twice": "second master", "third party between": "thief"}


def outcome(found: Any, trial: str) -> dict[str, str]:
    """Who paired, and why the others did not."""
    return {who: "paired" if end["paired"] else end["reason"] for who, end in found["ends"][trial].items()}


def is_expected(found: Any, trial: str) -> bool:
    ended = outcome(found, trial)
    return all(any(one in ended.get(who, "") for one in reason.split("|")) for who, reason in CASES[trial].items())


@pytest.fixture(scope="module")
def found(request: pytest.FixtureRequest) -> Any:
    """Trials; those that did not end as expected once more, with the patience of a machine that is busy."""
    explores = request.config.getoption("--hunt")
    chosen = "few" if explores else ",".join((*ESSENTIAL, *PAIRED, *ALONE))
    first = pairings("--attacks", chosen, "--patience", "2", "--at-once", "32")
    late = [name for name in (CASES if explores else ESSENTIAL) if not is_expected(first, name)]
    if late:
        again = pairings("--attacks", ",".join(late), "--patience", "15")
        for key in ("ends", "sound"):
            first[key] |= again[key]
    return first


def test_no_attack_leaves_a_foreign_or_a_refused_peer(found: Any) -> None:
    assert [name for name, is_sound in found["sound"].items() if not is_sound] == []


@pytest.mark.parametrize(
    "trial", [*PAIRED, *(pytest.param(name, marks=pytest.mark.hunt) for name in ("twice", "server restarted"))]
)
def test_two_hosts_pair(found: Any, trial: str) -> None:
    assert outcome(found, trial) == {"slave": "paired", "master": "paired"}


@pytest.mark.parametrize(
    "trial", [pytest.param(name, marks=() if name in ESSENTIAL else pytest.mark.hunt) for name in CASES]
)
def test_hosts_refuse_with_the_reason(found: Any, trial: str) -> None:
    assert is_expected(found, trial), outcome(found, trial)


@pytest.mark.parametrize(("trial", "late"), ALONE.items())
def test_a_code_serves_two_hosts_alone(found: Any, trial: str, late: str) -> None:
    reason = outcome(found, trial)[late]
    assert GONE in reason or "was used already" in reason


def test_the_mailbox_learns_neither_key_nor_names(found: Any) -> None:
    assert found["learnt"] == []


@pytest.mark.hunt
def test_no_change_of_any_message_leaves_a_foreign_peer() -> None:
    found = pairings("--attacks", "every")
    assert [name for name, is_sound in found["sound"].items() if not is_sound] == []


@pytest.mark.hunt
def test_random_pairings_do_not_fail(request: pytest.FixtureRequest) -> None:
    assert pairings("--number", str(100 * request.config.getoption("--hunt")))["failures"] == []
