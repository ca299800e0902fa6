"""What judges the driver: the record of the simulator, and the figures made of it."""

from pathlib import Path
from time import monotonic

import numpy as np
import pytest

from tests.franka.figures import contact, likeness, pace
from tests.franka.truth import Truth, TruthWriter

SECONDS = 2


def recorded(path: Path, lost: tuple[int, ...] = (), moving: int = 1) -> Truth:
    """Some seconds in which the arm presses on the table now and then, and cycles without an answer."""
    writer, began = TruthWriter(path), monotonic() - SECONDS
    for tick in range(SECONDS * 1000):
        row = writer.next_row()
        row["at"] = began + 1e-3 * tick
        row["moving"], row["success"] = moving, 1.0
        row["force"] = (0.0, 0.0, max(0.0, 5.0 * np.sin(2.0 * np.pi * 1e-3 * tick)))
        row["lost"] = tick in lost
        if tick not in lost:
            writer.arrived(began + 1e-3 * tick)
        writer.close_row(row)
    return Truth(path)


def test_pace_counts_lost_cycles(tmp_path: Path) -> None:
    truth = recorded(tmp_path / "rows", lost=(1000, 1500))
    found = pace(truth, 0.0, monotonic())
    assert (found.lost, found.lost_in_a_row, found.commands) == (2, 1, SECONDS * 1000 - 2)
    assert found.period_ms == pytest.approx((1.0, 1.0, 2.0), abs=1e-3)
    assert found.robot_ms == pytest.approx((1.0, 1.0, 1.0), abs=1e-3)


def test_pace_without_control_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nobody controlled"):
        pace(recorded(tmp_path / "rows", moving=0), 0.0, monotonic())


def test_likeness_finds_lag_and_gain(tmp_path: Path) -> None:
    rows = recorded(tmp_path / "rows").since(0.0)
    found = likeness(rows, rows["at"] + 0.02, 0.9 * rows["force"])
    assert (found.lag_ms, found.gain) == pytest.approx((20.0, 0.9), abs=0.05)
    assert found.correlation > 0.999


def test_likeness_shows_the_wrong_sign(tmp_path: Path) -> None:
    rows = recorded(tmp_path / "rows").since(0.0)
    assert likeness(rows, rows["at"], -rows["force"]).correlation < 0.0


def test_contact_counts_touches(tmp_path: Path) -> None:
    touched = contact(recorded(tmp_path / "rows").since(0.0))
    assert (touched["times"], touched["most_n"]) == (SECONDS, pytest.approx(5.0, abs=1e-3))


def test_record_keeps_the_newest_rows(tmp_path: Path) -> None:
    writer = TruthWriter(tmp_path / "rows", length=100)
    for tick in range(110):
        row = writer.next_row()
        row["at"] = float(tick)
        writer.close_row(row)
    rows = Truth(tmp_path / "rows").since(0.0)
    assert (len(rows), rows["at"][0], rows["at"][-1]) == (100, 10.0, 109.0)
    assert Truth(tmp_path / "rows").latest()["at"] == 109.0


@pytest.mark.parametrize(("speed", "rests"), [(0.0, True), (0.1, False)])
def test_rest_is_of_the_joints(tmp_path: Path, speed: float, rests: bool) -> None:
    writer, began = TruthWriter(tmp_path / "rows"), monotonic() - 1.0
    for tick in range(1000):
        row = writer.next_row()
        row["at"] = began + 1e-3 * tick
        row["dq"][:] = 0.1 if tick < 300 else speed
        writer.close_row(row)
    found = Truth(tmp_path / "rows").seconds_to_rest(began, within=0.5, hold=0.2)
    assert found == pytest.approx(0.299, abs=0.002) if rests else found is None
