"""Two hosts pair through a real mailbox server, among attacks by it and by third parties."""

import json
import subprocess
import sys
from typing import Any

import pytest

from tests.program import ROOT

pytest.importorskip("wormhole_mailbox_server")
PATIENCE = 300.0  # until the program counts as hung [s]
VOID = "a wrong code, or a message changed on the way"
SILENT = "the other host stopped answering"
GONE = "nobody waits with the code|was used already"
PAIRED = {"slave": "paired", "master": "paired"}
CASES = {
    "honest": PAIRED,
    "wrong code": {"slave": VOID, "master": VOID},
    "third party first": {"slave": VOID, "thief": VOID, "master": GONE},
    "code used twice": {"thief": GONE},
    "thief with the code": {"slave": "did not confirm the words", "thief": "refused: the person", "master": GONE},
    "words refused": {"slave": "did not confirm the words", "master": "refused: the person at the robot did not"},
    "changed 0 slave": {"slave": VOID, "master": SILENT},
    "drop 1 slave": {"slave": SILENT, "master": SILENT},
    "changed pake slave": {"slave": "sent what is no message of a pairing", "master": SILENT},
    "changed 2 slave": {"slave": VOID},
    "two slaves": {"slave": "the same side", "master": "the same side"},
    "recorded": {"second slave": VOID},
}
"""How each trial ends for whom."""


def pairings(trials: list[str], patience: float) -> Any:
    command = [sys.executable, "-m", "plugins.anywhere.tests.pairings", str(patience), *trials]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return json.loads(ended.stdout)


def test_hosts_pair_or_refuse_with_the_reason() -> None:
    found = pairings([name for name in CASES if name != "honest"], 2.0)

    def others() -> list[str]:
        return [
            name
            for name, ends in CASES.items()
            if not all(any(one in found["ends"][name][who] for one in why.split("|")) for who, why in ends.items())
        ]

    if late := others():  # with the patience of a machine that is busy
        again = pairings(late, 15.0)
        found["ends"] |= again["ends"]
        found["unsound"] += again["unsound"]
    assert {name: found["ends"][name] for name in others()} == {}
    assert found["unsound"] == [], "what a host holds is not what it paired with"
    assert found["learnt"] == [], "the mailbox learns neither key nor names"
    assert found["words"]["slave"] == found["words"]["master"], "honest hosts show the same words"
    assert len(found["words"]["slave"].split()) == 2
