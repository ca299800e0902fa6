"""A HID port that drops nothing, on a device that is handed in."""

from collections.abc import Sequence
from time import monotonic

import pytest

from weberlink.master.devices.polhem.hid_line import all_reports


class Scripted:
    """As hidapi, not blocking: `waiting` can be read at once, and `later` comes within a read that waits."""

    def __init__(self, waiting: Sequence[bytes] = (), later: Sequence[bytes] = ()) -> None:
        self._waiting = list(waiting)
        self._later = list(later)
        self.timeouts: list[int] = []

    def read(self, size: int, timeout_ms: int = 0, /) -> list[int]:
        if timeout_ms:
            self.timeouts.append(timeout_ms)
            self._waiting += self._later
            self._later = []
        return list(self._waiting.pop(0))[:size] if self._waiting else []


A, B, C = b"\x01" * 14, b"\x02" * 14, b"\x03" * 14


@pytest.mark.parametrize(
    ("waiting", "later", "expected"),
    [([], [], []), ([A], [], [A]), ([A, B, C], [], [A, B, C]), ([], [A], [A]), ([], [A, B, C], [A, B, C])],
)
def test_no_report_is_dropped(waiting: list[bytes], later: list[bytes], expected: list[bytes]) -> None:
    assert all_reports(Scripted(waiting, later), monotonic() + 0.01) == expected


def test_without_patience_only_what_waits_is_read() -> None:
    device = Scripted([A], [B])
    assert all_reports(device, 0.0) == [A]
    assert all_reports(device, 0.0) == []
    assert device.timeouts == []


def test_a_time_that_is_over_is_no_wait_without_end() -> None:
    """0 ms would mean just that to hidapi."""
    device = Scripted()
    assert all_reports(device, monotonic() - 1.0) == []
    assert device.timeouts == [1]
