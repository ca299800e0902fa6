"""Sessions within a bounded rate, and what the report says of failures made on purpose."""

import re
from dataclasses import replace
from math import inf

import pytest

from tests.program import ROOT
from tests.safety.observed_link import ObservedLink, observed
from tests.session.systems import configuration
from weberlink.codec.rate import LEAST_BURST
from weberlink.protocol.emulation import Emulation
from weberlink_figures.reporting import simulated
from weberlink_figures.session import score_of
from weberlink_figures.tree import FAILURE, Figures
from weberlink_figures.verdict import verdict

FILE = "rotation.yaml"
MOST = 5.0
SECONDS = 2.5
CHANNELS = {"force": "force", "position": "position"}
CHANNELS |= {name: f"rotation.{name}" for name in ("torque", "orientation")}
NARROW = (
    "codec.force.weber=0", "codec.force.floor_n=0.001", "codec.position.weber=0", "codec.position.bound_m=0.00001",
    "codec.rotation.torque.weber=0", "codec.rotation.torque.floor_nm=0.0001", "codec.rotation.orientation.weber=0",
    "codec.rotation.orientation.bound_rad=0.0001",
)  # fmt: skip
BOUNDED = tuple(f"codec.{key}.max_updates_per_s={MOST:g}" for key in CHANNELS.values())


def test_every_channel_keeps_its_rate() -> None:
    free = simulated(configuration(*NARROW, file=FILE), SECONDS).to_json()
    bounded = simulated(configuration(*NARROW, *BOUNDED, file=FILE), SECONDS).to_json()
    assert bounded["outcome"] == "completed"
    for name in CHANNELS:
        assert free[name]["packets"] > 2 * (MOST * SECONDS + LEAST_BURST)
        assert free[name]["widened_fraction"] == 0.0
        assert free[name]["widened_max"] is None
        assert bounded[name]["packets"] <= MOST * SECONDS + LEAST_BURST + 2, "and one forced at the beginning"
        assert 0.2 < bounded[name]["widened_fraction"] <= 1.0
        assert bounded[name]["widened_max"] > 0.0
    assert bounded["force"]["coding"]["violation_fraction"] == 0.0


PAGE = (ROOT / "docs" / "operation" / "logs.md").read_text(encoding="utf-8")
ROWS = {
    done: (line, int(status))
    for done, line, status in re.findall(r"^\| (.+?) \| `((?:good|degraded|failed)[^`]*)` \| (\d) \|$", PAGE, re.M)
}
"""By what was done: the verdict in one line, and the exit status."""
VIRTUAL = {
    "30 % of the datagrams lost": ("link.emulate={loss: 0.3, seed: 3}",),
    "60 ms of delay": ("link.emulate={delay_ms: 30, seed: 3}", "control.scheme=none"),
    "a contact stronger than `slave.limits.trip_n`": ("slave.limits.trip_n=3",),
    "a scene stiffer than `master.limits.force_n`": ("master.limits.force_n=0.5",),
    "nothing": (),
}
CUT = {"the link cut in one direction for 2 s": 2.0, "the link cut in one direction until the end": inf}


def cut(for_s: float) -> Figures:
    """The link carries nothing in one direction from 2 s on; a run of 6 s, which the master ends in order."""
    loaded = configuration()
    score = score_of(loaded.system)
    observed(loaded, ObservedLink(Emulation(blackouts=((2.0, for_s),))), ObservedLink()).run(6.0, [score.add])
    return replace(score.figures(), outcome="completed")


@pytest.mark.parametrize("done", [*VIRTUAL, *CUT])
def test_the_report_is_as_written(done: str) -> None:
    """The word, every cause of the page, and the status; numbers may differ, and the host may add causes."""
    found = verdict(cut(CUT[done]) if done in CUT else simulated(configuration(*VIRTUAL[done]), 3.0))
    line, status = ROWS[done]
    word, _, causes = line.partition(" because ")
    assert (found.word, found.word == FAILURE) == (word, bool(status))
    for cause in filter(None, causes.split("; ")):
        assert shape(cause) in shape(found.line), found


def shape(line: str) -> str:
    return re.sub(r"(?:127\.0\.0\.1:)?\d+(?:\.\d+)?", "#", line)
