"""Ctrl-C ends the piece of work under way, and nothing else."""

import os
import signal
from collections.abc import Iterator

import pytest

from weberlink.system.interruption import Interruption


@pytest.fixture(autouse=True)
def default_handler() -> Iterator[None]:
    """That of a program; a test runner may have its own."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def work(interrupted_at: int) -> Iterator[int]:
    for piece in range(5):
        if piece == interrupted_at:
            os.kill(os.getpid(), signal.SIGINT)
            signal.pause()
        yield piece


def test_ctrl_c_in_a_piece_keeps_finished_ones() -> None:
    interruption = Interruption()
    assert list(interruption.pieces(work(3))) == [0, 1, 2]
    assert interruption.noted
    assert list(interruption.pieces(work(9))) == [], "all loops of the run are over"


def test_ctrl_c_between_pieces_waits_for_their_use() -> None:
    interruption, used = Interruption(), []
    for piece in interruption.pieces(work(9)):
        if piece == 2:
            os.kill(os.getpid(), signal.SIGINT)
        used.append(piece)
    assert used == [0, 1, 2]
    assert interruption.noted


def test_handler_is_restored() -> None:
    assert list(Interruption().pieces(work(9))) == [0, 1, 2, 3, 4]
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
        signal.pause()
