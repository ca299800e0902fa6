"""Around a run: targets that are tried before it, Ctrl-C in the middle, JSON that nobody vouches for."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from weberlink.bounded_json import DEEPEST, parse
from weberlink.session.interruption import Interruption
from weberlink.session.targets import TargetError, check_file, check_folder


def test_good_targets_leave_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "old.json").write_text("kept")
    os.mkfifo(tmp_path / "pipe")
    before = sorted(path.name for path in tmp_path.iterdir())
    for name in ("new.json", "old.json", "pipe"):
        check_file(tmp_path / name)
    check_file(Path("/dev/null"))
    check_folder(tmp_path)
    check_folder(tmp_path / "made" / "later")
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    assert (tmp_path / "old.json").read_text() == "kept"


@pytest.mark.parametrize(
    ("check", "name", "told"),
    [
        (check_file, ".", "is a folder; give the name of a file"),
        (check_file, "file/a", "is not a folder; create it first"),
        (check_file, "a" * 300, "give a shorter name"),
        (check_file, "/sys/a", "give another place"),
        (check_folder, "file", "is not a folder; give another place"),
        (check_folder, "/sys/plots", "give another place"),
    ],
)
def test_bad_targets_say_what_to_do(check: Callable[[Path], None], name: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(TargetError, match=told):
        check(tmp_path / name)


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


@pytest.mark.parametrize("depth", [1, DEEPEST - 1, DEEPEST])
def test_what_is_within_the_bounds_is_read(depth: int) -> None:
    assert str(parse(b"[" * depth + b"]" * depth, 1000)) == "[" * depth + "]" * depth
    assert parse(b'{"a": [1, -2.5e-3, true, null, "x"]}', 1000) == {"a": [1, -0.0025, True, None, "x"]}


@pytest.mark.parametrize(
    "text",
    [
        b"[" * 100_000,
        b"[" * (DEEPEST + 1) + b"]" * (DEEPEST + 1),
        b'{"a":' * (DEEPEST + 1) + b"1" + b"}" * (DEEPEST + 1),
        b"NaN",
        b"[-Infinity]",
        b"1e999",
        b"1" * 5000,
        b"\xff",
        b"",
        b'"' + b"x" * 1_000_000 + b'"',
    ],
)
def test_everything_else_is_a_value_error(text: bytes) -> None:
    with pytest.raises(ValueError):
        parse(text, 200_000)
