"""The smoothed play-out: every update is used the same time after its sample, whatever the jitter of the link."""

from pathlib import Path

from weberlink.system.configuration import load
from weberlink.system.simulate import build_simulation

ROOT = Path(__file__).parents[2]
JITTER = "link.emulate={delay_ms: 10, jitter_ms: 15, seed: 3}"


def waits(*overrides: str) -> list[float]:
    """For each position update that the slave has used, the ticks since its sample."""
    simulation = build_simulation(load(ROOT / "configs" / "loopback.yaml", (JITTER, "control.scheme=none", *overrides)))
    found = []
    for tick in range(4000):
        simulation.step()
        (channel,) = simulation.slave.incoming
        if channel.received and tick > 1500:
            found.append(tick - channel.decoder.newest.tick)
    simulation.close()
    assert len(found) > 30
    return found


def test_updates_are_used_at_a_constant_age() -> None:
    plain, smooth = waits(), waits("link.playout_ms=20")
    assert max(plain) - min(plain) > 8
    assert max(smooth) - min(smooth) <= 1
    assert min(plain) + 20 <= max(smooth) <= min(plain) + 22


def test_playout_leaves_the_datagrams_of_a_silent_link_away() -> None:
    """What waits when the session falls silent is never used."""
    blackout = "link.emulate={delay_ms: 10, blackouts_s: [[1.0, 1.0]]}"
    overrides = (blackout, "link.playout_ms=40", "control.scheme=none")
    simulation = build_simulation(load(ROOT / "configs" / "loopback.yaml", overrides))
    for tick in range(1990):
        simulation.step()
        if tick > 1100:
            assert not simulation.slave.incoming[0].received
    simulation.close()
