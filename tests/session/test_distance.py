"""The shipped files work at any distance as they are: nothing but the link is set."""

from pathlib import Path

import pytest

from weberlink.config import load
from weberlink.figures.verdict import verdict
from weberlink.session.simulation import simulate

CONFIGS = Path(__file__).parents[2] / "configs"
KEYLESS = ("link.listen=127.0.0.1:47000", "link.slave=127.0.0.1:47000", "link.security=none")
FILES = {
    "loopback.yaml": (),
    "lan.yaml": KEYLESS,
    "try.yaml": (),
}


@pytest.mark.parametrize(("file", "delay_ms"), [*zip(FILES, (50, 150, 20), strict=True)])
def test_a_shipped_file_is_connected_from_start_to_end(file: str, delay_ms: int) -> None:
    emulate = f"link.emulate={{delay_ms: {delay_ms}, jitter_ms: 5, loss: 0.02, seed: 1}}"
    figures, _ = simulate(load(CONFIGS / file, (*FILES[file], emulate)), 3.0)
    assert figures.outcome == "completed"
    assert figures.faults == {"master": {}, "slave": {}}
    for side in figures.connection.values():
        assert side is not None and (side.interruptions, side.unconnected_s, side.ended) == (0, 0.0, "connected")
    assert {cause.name for cause in verdict(figures).causes} <= {"felt", "delay", "loss"}


def test_a_link_beyond_the_limit_is_refused_with_both_figures_and_works_with_a_higher_one() -> None:
    far = "link.emulate={delay_ms: 250, seed: 0}"
    summary = simulate(load(CONFIGS / "loopback.yaml", (far,)), 4.0)[0].to_json()
    for side in ("master", "slave"):
        assert summary["faults"][side]["refused"] >= 1
        assert summary["connection"][side]["connected_s"] == 0.0
    assert "500 ms" in summary["outcome"] and "400" in summary["outcome"]
    summary = simulate(load(CONFIGS / "loopback.yaml", (far, "link.longest_round_trip_ms=600")), 3.0)[0].to_json()
    assert summary["faults"] == {"master": {}, "slave": {}}
    assert summary["connection"]["master"]["interruptions"] == 0
    assert summary["connection"]["master"]["connected_s"] > 1.5
