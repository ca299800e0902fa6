"""A program leads a live session of arms at 30 Hz, and is killed."""

import os
import signal
from math import pi, sin
from time import monotonic, sleep

import numpy as np
import pytest

from tests.plugins.live_arms import LiveArms
from weberlink.apps.live_ends import LiveEnd
from weberlink.apps.remote_lead import RemoteLead
from weberlink.geometry.joints import Joints
from weberlink.telemetry.record import RELEASED

pytest.importorskip("mujoco")

FILE = "plugins/arms-remote.yaml"
SWING_RAD = 0.3


def lead_on(lead: RemoteLead, home: Joints, seconds: float, end: LiveEnd) -> list[float]:
    """Swing the first joint at 0.25 Hz; returns where the follower was."""
    began, seen = monotonic(), []
    while (time := monotonic() - began) < seconds:
        lead.send((home[0] + SWING_RAD * sin(0.5 * pi * time), *home[1:]))
        seen.append(float(end.sample().position[0]))
        sleep(1 / 30)
    return seen


def released_after(live: LiveArms, longest: float = 1.0) -> float:
    """How long from now until the follower knows that nobody leads [s]."""
    began, ring = monotonic(), live.ring("slave")
    while monotonic() - began < longest:
        records = ring.read()
        if len(records) and records["ramping"][-1] == RELEASED:
            ring.close()
            return monotonic() - began
        sleep(0.005)
    raise AssertionError("the follower is still led")


@pytest.mark.hunt
@pytest.mark.realtime
def test_killed_program_leaves_the_follower_at_rest() -> None:
    with LiveArms(FILE) as live:
        end = live.end("slave")
        home = tuple(end.sample().position.tolist())
        pid = os.fork()
        if pid == 0:
            lead_on(RemoteLead(live.session), home, 60.0, end)
            os._exit(0)
        sleep(1.5)
        moved = float(end.sample().position[0])
        assert moved - home[0] > 0.5 * SWING_RAD
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        assert released_after(live) < 0.5, "200 ms of silence, and the way to the follower"
        sleep(0.2)
        held = end.sample().position
        sleep(0.3)
        assert np.abs(end.sample().position - held).max() < 0.01
        with_lead = RemoteLead(live.session)
        lead_on(with_lead, home, 1.0, end)
        with_lead.close()
        assert released_after(live) < 0.2, "who lets go is not waited for"
        end.close()
    assert live.summary["outcome"] == "interrupted"
    assert live.summary["faults"] == {"master": {}, "slave": {}}
