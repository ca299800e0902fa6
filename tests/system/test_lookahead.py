"""Look-ahead in whole sessions, in virtual time and live."""

import pytest

from tests.program import PATIENT, Program, document, faults_of
from tests.system.systems import configuration, steps, system
from weberlink.geometry.vector import distance
from weberlink.protocol.states import State
from weberlink.system.composition.link import agreement
from weberlink.system.configuration import ConfigurationError

TICKS = 20
BOTH = ("codec.force.lookahead_ms=20", "codec.position.lookahead_ms=5")
HALF_STEP = 1e-3
"""Rounding of a force on the wire [N], and more."""


@pytest.mark.parametrize("predictor", ["hybrid", "path", "adaptive"])
def test_both_ends_hold_the_same_and_the_delayed_force_within_the_deadband(predictor: str) -> None:
    simulation = system(*BOTH, f"codec.force.predictor={predictor}", "control.scheme=none")
    sends = 0
    for step in steps(simulation, 2.0):
        slave = step.slave
        if slave.state != State.ENGAGED.value or slave.ramping:
            continue
        coded = (slave.coded_x, slave.coded_y, slave.coded_z)
        held = (slave.decoded_x, slave.decoded_y, slave.decoded_z)
        assert distance(held, coded) <= max(slave.bound, HALF_STEP)
        if not slave.sent:
            assert repr(simulation.master.incoming[0].decoder.state) == repr(
                simulation.slave.outgoing[0].encoder.mirror.state
            )
        sends += slave.sent
    assert sends > 0


def test_what_is_decided_on_was_measured_that_long_ago() -> None:
    measured: dict[int, tuple[float, ...]] = {}
    compared = 0
    for step in steps(system(*BOTH), 2.0):
        slave = step.slave
        measured[slave.tick] = (slave.raw_x, slave.raw_y, slave.raw_z)
        if slave.state == State.ENGAGED.value and not slave.ramping and slave.coded_z != 0.0:
            assert (slave.coded_x, slave.coded_y, slave.coded_z) == measured[slave.tick - TICKS]
            compared += 1
    assert compared > 100


def test_the_ends_must_agree_on_it() -> None:
    one, other = (agreement(configuration(*overrides).system) for overrides in ((), BOTH))
    differ = {path for path in one if one[path] != other[path]}
    assert differ == {"codec.force.lookahead_ms", "codec.position.lookahead_ms"}


@pytest.mark.parametrize("override", ["codec.force.lookahead_ms=101", "codec.position.lookahead_ms=-1"])
def test_out_of_range_is_refused(override: str) -> None:
    with pytest.raises(ConfigurationError, match="lookahead_ms"):
        configuration(override, "link.silence_ms=1000")


def test_a_sample_would_be_stale_within_the_silence_limit() -> None:
    with pytest.raises(ConfigurationError, match=r"at most 50, half of link\.silence_ms"):
        configuration("codec.force.lookahead_ms=60", "link.silence_ms=100")


@pytest.mark.realtime
def test_a_live_session_runs_with_it() -> None:
    overrides = [word for each in (*BOTH, "codec.force.predictor=adaptive") for word in ("--set", each)]
    with Program("loopback", "--duration", 1.2, "--json", "-", *PATIENT, *overrides) as program:
        status, output, _ = program.finish()
    summary = document(output)
    assert (status, summary["outcome"]) == (0, "completed")
    assert faults_of(summary) == {"master": {}, "slave": {}}
    assert summary["force"]["packets"] > 0
    late = summary["ticks"]["slave"]
    assert summary["force"]["coding"]["violation_fraction"] <= late["missed"] / late["count"]
    assert summary["lookahead_ms"] == {"position": 5.0, "force": 20.0}
