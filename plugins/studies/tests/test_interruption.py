"""Ctrl-C in long work keeps the pieces that are done."""

import os
import signal
from collections.abc import Iterator

import pytest

from weberlink_studies.interruption import Interruption


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def number(request: pytest.FixtureRequest) -> Iterator[signal.Signals]:
    """A signal with the handler of a program; a test runner may have its own."""
    before = signal.signal(request.param, signal.default_int_handler)
    yield request.param
    signal.signal(request.param, before)


def work(interrupted_at: int, number: signal.Signals = signal.SIGINT) -> Iterator[int]:
    for piece in range(5):
        if piece == interrupted_at:
            os.kill(os.getpid(), number)
            signal.pause()
        yield piece


def test_signal_in_a_piece_keeps_finished_ones(number: signal.Signals) -> None:
    interruption = Interruption()
    assert list(interruption.pieces(work(3, number))) == [0, 1, 2]
    assert interruption.noted
    assert list(interruption.pieces(work(9))) == [], "all loops of the run are over"


def test_signal_between_pieces_waits_for_their_use(number: signal.Signals) -> None:
    interruption, used = Interruption(), []
    for piece in interruption.pieces(work(9)):
        if piece == 2:
            os.kill(os.getpid(), number)
        used.append(piece)
    assert used == [0, 1, 2]
    assert interruption.noted


def test_what_the_signal_breaks_is_part_of_the_end(number: signal.Signals) -> None:
    """A worker process that got the signal too is gone; without a signal the same is an error."""

    def broken(at: int) -> Iterator[int]:
        try:
            yield from work(at, number)
        finally:
            raise RuntimeError("a worker has gone")

    interruption = Interruption()
    assert list(interruption.pieces(broken(2))) == [0, 1]
    with pytest.raises(RuntimeError):
        list(Interruption().pieces(broken(9)))
