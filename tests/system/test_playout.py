"""The smoothed play-out: every update is used the same time after its sample, whatever the jitter of the link."""

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from weberlink.system.check import describe
from weberlink.system.configuration import Configuration, ConfigurationError, load
from weberlink.system.report import session_report
from weberlink.system.simulate import build_simulation, simulate

ROOT = Path(__file__).parents[2]
JITTER = "link.emulate={delay_ms: 10, jitter_ms: 15, seed: 3}"


def loopback(*overrides: str) -> Configuration:
    return load(ROOT / "configs" / "loopback.yaml", ("control.scheme=none", *overrides))


def waits(*overrides: str) -> list[float]:
    """For each position update that the slave has used, the ticks since its sample."""
    simulation = build_simulation(loopback(JITTER, *overrides))
    found: list[float] = []
    for tick in range(2300):
        simulation.step()
        (channel,) = simulation.slave.incoming
        if channel.received and tick > 1000:
            assert channel.decoder.newest is not None
            found.append(tick - channel.decoder.newest.tick)
    simulation.close()
    assert len(found) > 30
    return found


def test_updates_are_used_at_a_constant_age() -> None:
    plain, smooth = waits(), waits("link.playout_ms=20")
    assert max(plain) - min(plain) > 8
    assert max(smooth) - min(smooth) <= 1
    assert 30 <= max(smooth) <= 33, "the least delay of 10 ms, and the play-out"


def test_what_waits_at_silence_is_never_used() -> None:
    overrides = ("link.emulate={delay_ms: 10, blackouts_s: [[1.0, 1.0]]}", "link.playout_ms=40")
    simulation = build_simulation(loopback(*overrides))
    for tick in range(1990):
        simulation.step()
        if tick > 1100:
            assert not simulation.slave.incoming[0].received
    simulation.close()


def test_check_and_report_say_it() -> None:
    configuration = loopback("link.playout_ms=20")
    assert any("20 ms later" in line for line in describe(configuration))
    summary, _ = simulate(configuration, 0.5)
    assert summary["playout_ms"] == 20.0
    console = Console(file=StringIO(), width=120)
    session_report(summary, "loopback", console)
    assert isinstance(console.file, StringIO)
    assert "play-out, on top of the fastest way: 20 ms at each end" in console.file.getvalue()


def test_a_playout_beyond_half_the_limit_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"link\.playout_ms: at most 50, half of link\.silence_ms"):
        loopback("link.playout_ms=60")
