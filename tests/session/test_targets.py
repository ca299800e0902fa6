"""Around a run: targets that are tried before it, Ctrl-C in virtual time, JSON that nobody vouches for."""

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.session.systems import configuration
from weberlink.bounded_json import DEEPEST, parse
from weberlink.session.simulation import simulate
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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_a_signal_ends_a_run_in_virtual_time_and_what_is_done_is_kept(number: signal.Signals) -> None:
    done = []

    def observe(master: Any, _slave: Any) -> None:
        os.kill(os.getpid(), number)
        done.append(len(master))

    before = signal.signal(number, signal.default_int_handler)
    try:
        facts = simulate(configuration(), 5.0, [observe])
        assert signal.getsignal(number) is signal.default_int_handler
    finally:
        signal.signal(number, before)
    assert (facts["outcome"], facts["interrupted"], done) == ("interrupted", True, [1000])


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
