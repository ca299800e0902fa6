"""What the two computed devices keep beyond the contract: virtual time, a hand that yields, bit for bit."""

from pathlib import Path
from typing import Any

import pytest

from weberlink.geometry.vector import Vector
from weberlink.master.devices import load
from weberlink.master.devices.contract import Device

TICK = 0.001
every_driver = pytest.mark.parametrize("name", ["operator", "replay"])


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A second of a small circle, which is what the replay driver needs to exist."""
    path = tmp_path / "circle.csv"
    rows = [f"{i * 0.01},{0.001 * (i % 7)},{0.0005 * i},{-0.0001 * i},0,0,0" for i in range(101)]
    path.write_text("\n".join(["t,px,py,pz,fx,fy,fz", *rows]) + "\n")
    return path


def device_of(name: str, recording: Path, **options: Any) -> Device:
    driver = load(name)
    return driver(driver.Options(**needed(name, recording), **options), TICK)


def needed(name: str, recording: Path) -> dict[str, Any]:
    return {"trace": recording} if name == "replay" else {}


@every_driver
def test_same_calls_give_identical_runs(name: str, recording: Path) -> None:
    def run(seed: int) -> list[Vector]:
        device = device_of(name, recording, seed=seed)
        positions = []
        for _ in range(2):  # a second session starts as afresh
            device.open(0.0)
            now = 0.0
            for tick in range(1, 1500):
                now += TICK * (1.0 + 0.3 * (tick % 3)) + (0.05 if tick == 50 else 0.0)
                positions.append(device.latest(now).position)
                device.command((0.0, 0.1 * (tick % 5), 0.5), now)
            device.close()
        assert positions[:1499] == positions[1499:]
        return positions

    assert run(1) == run(1)
    assert run(1) != run(2)


@every_driver
def test_long_gap_pauses_without_a_jump(name: str, recording: Path) -> None:
    device = device_of(name, recording)
    device.open(0.0)
    for tick in range(1, 600):
        before = device.latest(tick * TICK).position
    after = device.latest(3600.0)
    assert after.at == 3600.0
    assert max(abs(a - b) for a, b in zip(after.position, before, strict=True)) < 0.02


def test_an_unknown_driver_names_the_nearest() -> None:
    with pytest.raises(ValueError, match=r"'operater'.*nearest is 'operator'.*replay"):
        load("operater")
