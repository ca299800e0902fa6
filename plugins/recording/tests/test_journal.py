"""The journal of a session is a chain of lines: one that was changed, taken out or cut off is found."""

import json
from pathlib import Path

import pytest

from plugins.recording.tests.records import noise, origin
from tests.program import weberlink
from weberlink_figures.chain import START, Chain, verify
from weberlink_figures.log_file import LogFile
from weberlink_recording.reader import read_recording
from weberlink_recording.writer import RecordingWriter

EVENTS = [{"event": name, "side": "slave", "at_s": 0.1 * number} for number, name in enumerate("abcde")]


def chained() -> list[str]:
    chain, lines = Chain(), []
    for event in EVENTS:
        lines.append(chain.line(event))
        chain.append(lines[-1])
    return lines


def recorded(path: Path, lines: list[str], head: str) -> Path:
    """A finished recording with these lines, which says that the last one has this hash."""

    class Kept(Chain):
        def line(self, document: object) -> str:
            return str(document)

    with RecordingWriter.create(path, {"bank": "zoh"}) as writer:
        writer.add_side(origin("slave"))
        writer.write("slave", noise(5, 1))
        writer._chain = Kept()
        for number, line in enumerate(lines):
            writer.journal(number, line)  # type: ignore[arg-type]
        writer._chain.head = head
    return path


def test_lines_are_json_and_each_follows_on_the_one_before() -> None:
    lines = chained()
    assert [json.loads(line)["event"] for line in lines] == [*"abcde"]
    found = verify(line.encode() for line in lines)
    assert found == (5, 1, json.loads(lines[-1])["chain"], 0)
    assert verify([]) == (0, 0, START, 0)
    assert verify(line.encode() for line in lines + lines[:2]) == (7, 2, json.loads(lines[1])["chain"], 0)


def test_every_changed_byte_and_every_line_that_is_missing_or_moved_is_found(tmp_path: Path) -> None:
    lines = [line.encode() for line in chained()]
    for number, line in enumerate(lines):
        for place in range(len(line)):
            changed = line[:place] + bytes([line[place] ^ 1]) + line[place + 1 :]
            assert verify([*lines[:number], changed, *lines[number + 1 :]]).broken == number + 1
    for number in range(1, 4):
        assert verify([*lines[:number], *lines[number + 1 :]]).broken == number + 1
        assert verify([*lines[:number], lines[number + 1], lines[number], *lines[number + 2 :]]).broken == number + 1


def test_the_journal_of_a_recording_is_verified(tmp_path: Path) -> None:
    lines = chained()
    head = json.loads(lines[-1])["chain"]
    whole = read_recording(recorded(tmp_path / "whole.mcap", lines, head)).journal
    assert whole is not None and (whole.lines, whole.head, whole.broken) == (5, head, 0)
    other = [*lines[:2], lines[2].replace("slave", "slaves"), *lines[3:]]
    for name, content, line in (("changed", other, 3), ("short", lines[:4], 5)):
        journal = read_recording(recorded(tmp_path / f"{name}.mcap", content, head)).journal
        assert journal is not None and journal.broken == line


def test_a_log_that_goes_on_after_a_lost_line_is_verified_and_one_that_was_changed_has_status_1(tmp_path: Path) -> None:
    path = tmp_path / "session.log"
    for _ in range(2):
        with LogFile(path) as log:
            written = [log.write_json(event) for event in (EVENTS[0], {"text": "x" * 5000}, EVENTS[1])]
            assert written == [True, False, True]
    ended = weberlink("record", "info", path)
    assert (ended.status, "4 lines of 2 sessions, unchanged" in ended.output) == (0, True)
    path.write_bytes(path.read_bytes().replace(b'"b"', b'"c"', 1))
    ended = weberlink("record", "info", path)
    assert ended.status == 1 and "changed at line 2" in ended.errors


@pytest.mark.realtime
def test_a_live_recording_holds_a_journal_with_the_peers_by_name(tmp_path: Path) -> None:
    path, log = tmp_path / "live.mcap", tmp_path / "live.log"
    ended = weberlink("loopback", "--duration", "1.5", "--record", path, "--log", log)
    assert ended.status == 0, ended.errors
    told = weberlink("record", "info", path, "--json", "-")
    (file,) = json.loads(told.output)["files"]
    assert file["journal"]["lines"] > 5 and file["journal"]["broken"] == 0
    events = [json.loads(line) for line in log.read_text().splitlines()]
    peers = {each["side"]: each for each in events if each["event"] == "peer"}
    assert peers["master"]["name"] and peers["slave"]["name"]
    assert verify(log.read_bytes().splitlines()).broken == 0
