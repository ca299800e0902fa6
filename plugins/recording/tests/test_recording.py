"""Sessions that are recorded: what is in the file, what becomes of it when something dies, and what reads it."""

import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from plugins.recording.tests.records import write_elsewhere
from tests.program import ENGAGED, PATIENT, Program, document, weberlink
from tests.session.systems import CONFIGS, configuration
from tests.wait import until
from weberlink.config import load
from weberlink.session.recorder import virtual_recording
from weberlink.session.simulation import simulate
from weberlink.telemetry.record import COUNTERS
from weberlink_figures.message import ENCAPSULATION, TOPICS
from weberlink_figures.reporting import FiguresReport
from weberlink_recording.export import describe
from weberlink_recording.former import ADDED
from weberlink_recording.reader import Recording, RecordingError, dtype_of, read_recording
from weberlink_recording.session import put_together
from weberlink_recording.writer import Origin, RecordingWriter

LOOPBACK = CONFIGS / "loopback.yaml"
FORMER = Path(__file__).with_name("former")
HALF_STEP_N = 0.5e-3 * 3**0.5


def said(*arguments: object) -> str:
    """What a command that succeeds prints."""
    ended = weberlink(*arguments)
    assert (ended.status, ended.errors) == (0, ""), ended
    return ended.output


def info(*paths: Path) -> dict[str, Any]:
    return document(said("record", "info", *paths, "--json", "-"))


def complaint(path: Path, *command: object) -> str:
    """The one line of a command that cannot use a file."""
    told = weberlink(*(command or ("record", "info")), path).complaint()
    assert path.name in told
    return told


def numbers(tree: object) -> list[float]:
    """All numbers of a JSON document in order; a sum made in other pieces differs in its last digits."""
    if isinstance(tree, dict):
        return [number for branch in tree.values() for number in numbers(branch)]
    return [] if tree is None or isinstance(tree, str) else [float(tree)]  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A session in virtual time, and what its command said of it."""
    path = tmp_path_factory.mktemp("simulated") / "touch.mcap"
    return path, document(said("simulate", LOOPBACK, "--duration", 4, "--record", path, "--json", "-"))


@pytest.fixture(scope="module")
def touch(simulated: tuple[Path, dict[str, Any]]) -> Recording:
    return read_recording(simulated[0])


# --- what is in the file


RATES = [f"codec.{key}.max_updates_per_s=5" for key in ("force", "position", "rotation.torque", "rotation.orientation")]


def test_info_reports_the_figures_of_the_run(simulated: tuple[Path, dict[str, Any]]) -> None:
    path, summary = simulated
    found = info(path)
    for key in ("duration_s", "force", "position", "link", "energy"):
        assert found[key] == summary[key], key
    (file,) = found["files"]
    assert (file["complete"], file["clock"], file["began"]) == (True, "virtual", None)
    assert file["records"] == {side: summary["ticks"][side]["count"] for side in ("master", "slave")}
    assert not any(file["lost"].values())


def test_so_it_does_with_a_bounded_rate(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    settings = configuration(*RATES, file="rotation.yaml")
    report = FiguresReport(settings)
    recording = virtual_recording(settings, path, print)
    summary = report.end(simulate(settings, 2.2, [report.add, recording.add])).document
    assert recording.finish()["outcome"] == "complete"
    found = describe([path]).document
    for key in ("force", "position", "torque", "orientation", "energy"):
        assert found[key] == summary[key], key
    assert found["torque"]["widened_fraction"] > 0.0


def test_the_same_seed_gives_the_same_file_with_the_whole_configuration(touch: Recording, tmp_path: Path) -> None:
    restored, path = tmp_path / "restored.yaml", tmp_path / "again.mcap"
    restored.write_text(touch.facts["configuration"], encoding="utf-8")
    assert load(restored).system == load(LOOPBACK).system
    said("simulate", LOOPBACK, "--duration", 1, "--record", path)
    for side, records in read_recording(path).records.items():
        assert records[:900].tobytes() == touch.records[side][:900].tobytes()


def test_raw_sent_predicted_and_reconstructed_force_fit_together(touch: Recording) -> None:
    slave = touch.records["slave"]
    engaged = slave[(slave["state"] == ENGAGED) & (slave["ramping"] == 0)]
    error = np.linalg.norm(engaged["predicted"] - engaged["raw"], axis=1)
    sent = engaged["sent"] == 1
    assert 0 < sent.sum() < len(sent)
    assert (error[sent] > engaged["bound"][sent]).all()
    assert (error[~sent] <= engaged["bound"][~sent] + HALF_STEP_N).all()
    assert (engaged["decoded"][~sent] == engaged["predicted"][~sent]).all()
    reconstructed = np.linalg.norm(engaged["decoded"] - engaged["raw"], axis=1)
    assert (reconstructed <= engaged["bound"] + HALF_STEP_N).all()
    assert reconstructed[sent].mean() < error[sent].mean()


# --- files that are not whole, or not of a recorder


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda records: records["raw"].__setitem__((5, 0), np.nan), "position or force"),
        (lambda records: records["at"].__setitem__(-1, 1e15), "time"),
        (lambda records: records["fault"].__setitem__(5, 99), "fault"),
    ],
)
def test_what_no_recorder_writes_is_said_in_one_line(
    touch: Recording, tmp_path: Path, change: Callable[[Any], None], field: str
) -> None:
    records = touch.records["slave"].copy()
    change(records)
    path = tmp_path / "odd.mcap"
    with RecordingWriter.create(path, touch.facts) as writer:
        writer.add_side(Origin("slave", 1000.0, 0.0, 0.0))
        writer.write("slave", records)
    assert field in complaint(path)


def test_what_is_there_is_not_written_over(tmp_path: Path) -> None:
    taken = tmp_path / "taken.mcap"
    taken.write_text("mine")
    for command in ("loopback", "simulate"):
        complaint(taken, command, LOOPBACK, "--duration", 0.1, "--record")
        assert taken.read_text() == "mine"


@pytest.mark.parametrize("name", ["rotation", "arms"])
def test_recording_of_a_former_release_has_the_figures_of_that_release(name: str) -> None:
    """With columns of their own for what turns and for arms; the figures are those that it told itself."""
    told = document((FORMER / f"{name}.json").read_text(encoding="utf-8"))
    found = info(FORMER / f"{name}.mcap")
    for key, value in told.items():
        assert_same(found[key], value, key)


def assert_same(found: Any, told: Any, where: str) -> None:
    """To rounding; what is new may be there besides."""
    if isinstance(told, dict):
        for key, value in told.items():
            assert_same(found[key], value, f"{where}.{key}")
    else:
        assert found == (pytest.approx(told, rel=1e-6) if isinstance(told, float) else told), where


def test_recording_of_the_first_release_lacks_some_figures(tmp_path: Path) -> None:
    former, path = FORMER / "rotation.mcap", tmp_path / "turn.mcap"
    with former.open("rb") as file:
        messages = [*make_reader(file).iter_messages([*TOPICS.values()])]
    whole = messages[0][0].data.decode()
    text = "\n".join(line for line in whole.split("\n") if not any(f" {name} " in line for name in ADDED))
    old = {}
    for side, topic in TOPICS.items():
        body = b"".join(
            message.data[len(ENCAPSULATION) :] for _, channel, message in messages if channel.topic == topic
        )
        rows = np.frombuffer(body, dtype_of(whole))
        old[side] = np.zeros(len(rows), dtype_of(text))
        for name in old[side].dtype.names or ():
            old[side][name] = rows[name]
    recording = read_recording(former)
    write_elsewhere(path, old, text=text, facts=recording.facts, origins=recording.origins)
    now, then = info(former), info(path)
    for key in ("duration_s", "force", "torque", "position", "orientation", "link"):
        assert then[key] == now[key], key
    assert then["ways"]["jitter_us"] == {"p50": None, "p99": None}
    said("record", "export", path, "--to", "ros")
    again = read_recording(tmp_path / "turn-ros.mcap").records["slave"]
    for name in again.dtype.names or ():
        missing = np.full(len(again), ADDED.get(name, 0.0))
        np.testing.assert_array_equal(again[name], missing if name in ADDED else recording.records["slave"][name])


# --- files of two hosts


def only(recording: Recording, side: str, records: Any = None, *, later: float = 0.0) -> Recording:
    """One side alone, whose clock is later."""
    own = (recording.records[side] if records is None else records).copy()
    own["at"] += later
    return replace(recording, origins={side: recording.origins[side]}, records={side: own})


def test_files_of_one_session_are_joined_and_others_are_not(touch: Recording) -> None:
    assert len(put_together([only(touch, "master"), only(touch, "slave")]).slave) == len(touch.records["slave"])
    joined = put_together([only(touch, "master"), only(touch, "slave", later=50.0)])
    assert np.allclose(joined.slave["at"][100:], touch.records["slave"]["at"][100:], atol=1e-6)
    with pytest.raises(RecordingError):
        put_together([touch, touch])
    for peer_at in (touch.records["slave"]["peer_at"] + 100.0, np.nan):
        foreign = only(touch, "slave")
        foreign.records["slave"]["peer_at"] = peer_at
        with pytest.raises(RecordingError):
            put_together([only(touch, "master"), foreign])


def test_sessions_of_two_masters_are_told_apart(touch: Recording) -> None:
    once = touch.records["slave"]
    again = once.copy()
    again["at"] += 100.0  # peer_at counts from the tick 0 of the operator who came later
    for name in COUNTERS:
        again[name] += once[name][-1]
    whole_day = only(touch, "slave", np.concatenate([once, again]))
    alone = put_together([only(touch, "master"), only(touch, "slave")]).figures().to_json()
    for later in (0.0, 100.0):
        found = put_together([only(touch, "master", later=later), whole_day]).figures().to_json()
        for key in ("force", "position", "link", "energy"):
            assert numbers(found[key]) == pytest.approx(numbers(alone[key]), rel=1e-6, abs=1e-9), key
    with pytest.raises(RecordingError):
        put_together([only(touch, "master", later=50.0), whole_day])


# --- what becomes of the file when a process dies


@pytest.mark.realtime
def test_recording_of_a_session_that_ctrl_c_ends_says_what_its_report_says(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Program("loopback", *PATIENT, "--record", path, "--json", "-") as program:
        slave = program.engaged("slave")
        until(lambda: np.linalg.norm(slave.last["raw"]) > 1.0, "contact")
        contact = slave.last["tick"]
        until(lambda: slave.last["tick"] > contact + 1000, "ticks that count")
        program.send(signal.SIGINT)
        status, output, errors = program.finish()
    report, read = document(output), info(path)
    assert (status, errors, report["recording"]["outcome"], read["files"][0]["complete"]) == (0, "", "complete", True)
    for channel in ("force", "position"):
        assert read[channel]["packets"] == report[channel]["packets"]
        assert read[channel]["error_rms"] == pytest.approx(report[channel]["error_rms"], rel=1e-6)
    assert read["energy"]["dissipated_j"] == pytest.approx(report["energy"]["dissipated_j"], rel=1e-6)


@pytest.mark.realtime
@pytest.mark.parametrize("small_disk", ["1m"], indirect=True)  # the first chunk fits, if the recorder was held up too
def test_a_full_disk_ends_the_recording_alone(small_disk: Path) -> None:
    with Program("loopback", *PATIENT, "--record", small_disk / "a.mcap") as program:
        telemetry = program.engaged("slave")
        while "recording stopped" not in (line := program.next_error()):
            assert line, "the command ended without the line"
        at = telemetry.last["tick"]
        until(lambda: telemetry.last["tick"] > at, "the session to go on")
        program.send(signal.SIGINT)
        assert "No space left" in line + program.finish()[2]
    recording = read_recording(small_disk / "a.mcap")
    assert (recording.complete, len(recording.records["master"]) > 100) == (False, True)


def test_interrupted_simulation_keeps_report_and_recording(tmp_path: Path) -> None:
    path, out = tmp_path / "a.mcap", tmp_path / "out.json"
    with Program("simulate", LOOPBACK, "--duration", 3600, "--record", path, "--json", out) as program:
        until(lambda: path.exists() and path.stat().st_size > 50_000, "the first records")
        program.send(signal.SIGINT)
        assert program.finish()[0] == 130
    summary, recording = document(out.read_text()), read_recording(path)
    assert (summary["interrupted"], summary["outcome"], recording.complete) == (True, "interrupted", True)
    assert len(recording.records["master"]) == round(1e3 * summary["duration_s"])
