"""Sessions that are recorded: what is in the file, what becomes of it when something dies, and what reads it."""

import csv
import os
import signal
from pathlib import Path
from time import sleep

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from typer.testing import CliRunner

from tests.apps import arm_sessions
from tests.program import ENGAGED, Program, document, free_port
from tests.system.systems import CONFIGS
from tests.wait import until
from weberlink.cli import app
from weberlink.codec.replay import code
from weberlink.master.trace import read_motion, read_trace
from weberlink.studies.evaluate.replay import signal_of
from weberlink.system.composition.channels import channels
from weberlink.system.configuration import load
from weberlink.system.report import status_line
from weberlink.system.scoring.recorded import ADDED, put_together
from weberlink.telemetry.record import COUNTERS, FIELDS, JOINTS, Field
from weberlink.telemetry.recording.message import ENCAPSULATION, SCHEMA_NAME, SCHEMA_TEXT, dtype_of
from weberlink.telemetry.recording.reader import Recording, RecordingError, read_recording
from weberlink.telemetry.recording.writer import Origin, RecordingWriter

LOOPBACK = CONFIGS / "loopback.yaml"


def weberlink(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    return result.exit_code, result.stdout, result.stderr


def info(*paths: Path) -> dict:
    status, output, errors = weberlink("record", "info", *paths, "--json", "-")
    assert (status, errors) == (0, "")
    return document(output)


def numbers(tree: object) -> list[float]:
    """All numbers of a JSON document in order; a sum made in other pieces differs in its last digits."""
    if isinstance(tree, dict):
        return [number for branch in tree.values() for number in numbers(branch)]
    return [] if tree is None or isinstance(tree, str) else [float(tree)]  # type: ignore[arg-type]


def one_line(status: int, errors: str, *parts: str) -> None:
    assert status == 2
    assert errors.count("\n") == 1 and errors.startswith("weberlink: ")
    for part in parts:
        assert part in errors


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """A session in virtual time, and what its command said of it."""
    path = tmp_path_factory.mktemp("simulated") / "touch.mcap"
    status, output, errors = weberlink("simulate", LOOPBACK, "--duration", 4, "--record", path, "--json", "-")
    assert status == 0, errors
    return path, document(output)


class TestOfASimulation:
    def test_info_reports_the_figures_of_the_run(self, simulated):
        path, summary = simulated
        found = info(path)
        for key in ("duration_s", "force", "position", "link", "energy"):
            assert found[key] == summary[key], key
        (file,) = found["files"]
        assert file["complete"] and file["clock"] == "virtual" and file["began"] is None
        assert file["records"] == {side: summary["ticks"][side]["count"] for side in ("master", "slave")}
        assert not any(file["lost"].values())

    def test_the_same_seed_gives_the_same_file(self, simulated, tmp_path):
        path, _ = simulated
        again = tmp_path / "again.mcap"
        weberlink("simulate", LOOPBACK, "--duration", 4, "--record", again)
        a, b = read_recording(path), read_recording(again)
        assert all(a.records[side].tobytes() == b.records[side].tobytes() for side in a.records)

    def test_it_holds_the_configuration_with_overrides_and_defaults(self, tmp_path):
        path = tmp_path / "r.mcap"
        weberlink("simulate", LOOPBACK, "--duration", 0.2, "--record", path, "--set", "codec.force.bank=[plane, zoh]")
        facts = read_recording(path).facts
        assert facts["bank"] == "plane zoh"
        restored = tmp_path / "restored.yaml"
        restored.write_text(facts["configuration"], encoding="utf-8")
        assert load(restored).system == load(LOOPBACK, ["codec.force.bank=[plane, zoh]"]).system

    def test_raw_sent_predicted_and_reconstructed_force_fit_together(self, simulated):
        slave = read_recording(simulated[0]).records["slave"]
        engaged = slave[(slave["state"] == ENGAGED) & (slave["ramping"] == 0)]
        error = np.linalg.norm(engaged["predicted"] - engaged["raw"], axis=1)
        sent = engaged["sent"] == 1
        half_step = 0.5e-3 * 3**0.5
        assert sent.any() and not sent.all()
        assert (error[sent] > engaged["bound"][sent]).all()
        assert (error[~sent] <= engaged["bound"][~sent] + half_step).all()
        assert (engaged["decoded"][~sent] == engaged["predicted"][~sent]).all()
        reconstructed = np.linalg.norm(engaged["decoded"] - engaged["raw"], axis=1)
        assert (reconstructed <= engaged["bound"] + half_step).all()
        assert reconstructed[sent].mean() < error[sent].mean()

    def test_coding_again_sends_at_the_same_ticks(self, simulated):
        path, _ = simulated
        slave = read_recording(path).records["slave"]
        engaged = slave[slave["state"] == ENGAGED]
        trace = read_trace(path)
        assert (trace.force_n == engaged["raw"]).all()
        channel = channels(load(LOOPBACK).system)[1]
        again = [tick.update is not None for tick in code(channel, signal_of(trace).samples)]
        assert sum(again) > 10
        assert again == (engaged["sent"] == 1).tolist()

    def test_evaluate_takes_it_for_a_trace(self, simulated):
        status, output, errors = weberlink("study", "evaluate", simulated[0], "--predictor", "zoh", "--json", "-")
        assert status == 0, errors
        (row,) = document(output)["rows"]
        assert row["trace"] == "touch" and row["packets"] > 10

    def test_a_replayed_hand_makes_the_same_motion(self, simulated, tmp_path):
        path, _ = simulated
        motion = read_motion(path)
        files = [tmp_path / name for name in ("once.mcap", "twice.mcap")]
        for again in files:
            changes = ("trace=" + str(path), "center_m=null", "approach_s=1", "workspace_m=0.16", "tremor_m=0")
            overrides = [part for change in changes for part in ("--set", f"master.device.{change}")]
            status, _, errors = weberlink(
                "simulate", CONFIGS / "replay.yaml", *overrides, "--set", "slave.scene=[]",
                "--duration", 4, "--record", again,
            )  # fmt: skip
            assert status == 0, errors
        once, twice = (read_recording(again).records["master"] for again in files)
        assert once.tobytes() == twice.tobytes()
        followed = once["raw"][1000:4000]
        assert np.abs(followed - motion.position_m[:3000]).max() < 0.01
        assert np.ptp(motion.position_m[:3000], axis=0).max() > 0.02

    def test_csv_and_parquet_hold_the_same_numbers(self, simulated, tmp_path):
        path, _ = simulated
        for to in ("csv", "parquet"):
            status, output, errors = weberlink("record", "export", path, "--to", to, "--out", tmp_path)
            assert (status, errors) == (0, "") and output.count("\n") == (3 if to == "csv" else 2)
        recording = read_recording(path)
        parquet = pytest.importorskip("pyarrow.parquet")
        for side, records in recording.records.items():
            with (tmp_path / f"touch-{side}.csv").open(newline="", encoding="utf-8") as file:
                rows = list(csv.reader(file))
            table = parquet.read_table(tmp_path / f"touch-{side}.parquet")
            assert rows[0] == table.column_names
            assert len(rows) - 1 == table.num_rows == len(records)
            for name, at in (("raw_x", 0), ("raw_y", 1), ("raw_z", 2)):
                column = rows[0].index(name)
                assert [float(row[column]) for row in rows[1:]] == records["raw"][:, at].tolist()
                assert table[name].to_pylist() == records["raw"][:, at].tolist()
        status, _, errors = weberlink("record", "export", path, "--to", "csv", "--out", tmp_path)
        one_line(status, errors, "touch-master.csv exists")
        status, _, errors = weberlink("record", "export", path, "--to", "xlsx")
        one_line(status, errors, "--to", "csv, parquet")

    def test_exported_trace_gives_the_same_evaluation(self, simulated, tmp_path):
        path, _ = simulated
        status, output, errors = weberlink("record", "export", path, "--to", "csv", "--out", tmp_path)
        assert (status, errors) == (0, "")
        trace = tmp_path / "touch-trace.csv"
        assert f"{trace}: " in output
        rows = []
        for given in (path, trace):
            status, output, errors = weberlink("study", "evaluate", given, "--predictor", "zoh,hybrid", "--json", "-")
            assert (status, errors) == (0, "")
            rows.append(document(output)["rows"])
        assert len(rows[0]) == 2
        own = {"trace", "tick_us"}
        for recorded, read_back in zip(*rows, strict=True):
            for key in recorded.keys() - own:
                assert recorded[key] == read_back[key], key

    def test_export_without_contact_side_has_no_trace(self, simulated, tmp_path):
        path, _ = simulated
        recording = read_recording(path)
        alone = tmp_path / "alone.mcap"
        with RecordingWriter.create(alone, recording.facts) as writer:
            writer.add_side(recording.origins["master"])
            writer.write("master", recording.records["master"])
        status, _, errors = weberlink("record", "export", alone, "--to", "csv")
        assert (status, errors) == (0, "")
        assert [each.name for each in sorted(tmp_path.glob("*.csv"))] == ["alone-master.csv"]

    def test_a_full_disk_ends_the_recording_alone(self, small_disk):
        path = small_disk / "r.mcap"
        status, output, errors = weberlink("simulate", LOOPBACK, "--duration", 8, "--record", path, "--json", "-")
        assert status == 1, errors
        summary = document(output)
        assert summary["outcome"] == "completed" and "No space left" in summary["recording"]["outcome"]
        recording = read_recording(path)
        assert not recording.complete
        assert 0 < len(recording.records["slave"]) < summary["ticks"]["slave"]["count"]


class TestWhatIsNoRecording:
    @pytest.mark.parametrize(
        "command", [("record", "info"), ("record", "export", "--to", "csv"), ("study", "evaluate")]
    )
    @pytest.mark.parametrize(
        ("name", "content"),
        [
            ("text.mcap", b"t,px,py,pz,fx,fy,fz\n0,0,0,0,0,0,0\n"),
            ("empty.mcap", b""),
            ("cut.mcap", b"\x89MCAP0\r\n"),
            ("picture.mcap", b"\x89PNG\r\n\x1a\n" + bytes(100)),
        ],
    )
    def test_is_said_in_one_line(self, tmp_path, command, name, content):
        path = tmp_path / name
        path.write_bytes(content)
        status, output, errors = weberlink(*command, path)
        one_line(status, errors, name)
        assert output == ""

    def test_nothing_there(self, tmp_path):
        status, _, errors = weberlink("record", "info", tmp_path / "none.mcap")
        one_line(status, errors, "none.mcap")

    def test_the_same_side_twice(self, simulated):
        status, _, errors = weberlink("record", "info", simulated[0], simulated[0])
        one_line(status, errors, "master's side")

    @pytest.mark.parametrize("command", ["loopback", "simulate"])
    def test_a_target_that_is_taken_or_has_no_folder(self, tmp_path, command):
        taken = tmp_path / "taken.mcap"
        taken.write_text("mine")
        status, _, errors = weberlink(command, LOOPBACK, "--duration", 0.1, "--record", taken)
        one_line(status, errors, "taken.mcap exists")
        assert taken.read_text() == "mine"
        status, _, errors = weberlink(command, LOOPBACK, "--duration", 0.1, "--record", tmp_path / "no" / "r.mcap")
        one_line(status, errors, "is not a folder")


@pytest.mark.realtime
class TestOfALiveSession:
    def test_the_figures_are_those_that_the_session_reported(self, tmp_path):
        path = tmp_path / "live.mcap"
        with Program("loopback", "--duration", 1, "--record", path, "--json", "-") as program:
            status, output, errors = program.finish()
        assert status == 0, errors
        summary, found = document(output), info(path)
        recording = summary["recording"]
        assert recording["outcome"] == "complete" and not any(recording["lost"].values())
        assert recording["bytes"] == path.stat().st_size
        assert recording["records"] == {side: summary["ticks"][side]["count"] for side in ("master", "slave")}
        for key in ("duration_s", "force", "position", "link"):
            assert numbers(found[key]) == pytest.approx(numbers(summary[key]), rel=1e-9, nan_ok=True), key
        assert found["energy"] == pytest.approx(summary["energy"], rel=1e-9, abs=1e-12)

    @pytest.mark.hunt
    def test_a_recorder_that_is_killed_costs_the_recording_alone(self, tmp_path):
        path = tmp_path / "live.mcap"
        with Program("loopback", "--record", path, "--json", "-") as program:
            recorder, telemetry = program.recorder(), program.engaged("slave")
            until(lambda: path.exists() and path.stat().st_size > 60_000, "the recording to grow")
            os.kill(recorder, signal.SIGKILL)
            until(lambda: status_of(recorder) == b"Z", "the recorder to end")
            ended_at = int(telemetry.last["tick"])
            until(lambda: telemetry.last["tick"] > ended_at + 100, "the session to go on")
            program.send(signal.SIGTERM)
            status, output, _ = program.finish()
        summary = document(output)
        assert (status, summary["outcome"]) == (1, "terminated")
        assert "killed by signal 9" in summary["recording"]["outcome"]
        assert [cause["name"] for cause in summary["verdict"]["causes"] if cause["level"] == "failed"] == ["recording"]
        recording = read_recording(path)
        assert not recording.complete
        assert 100 < len(recording.records["slave"]) < summary["ticks"]["slave"]["count"]
        ticks = recording.records["slave"]["tick"]
        assert ended_at - 1500 < ticks[-1] <= ended_at + 500
        assert (np.diff(ticks) >= 1).all()
        assert info(path)["outcome"] == "cut off"

    @pytest.mark.parametrize("victim", ["daemon", pytest.param("command", marks=pytest.mark.hunt)])
    def test_a_kill_leaves_a_whole_file(self, victim, tmp_path):
        path = tmp_path / "live.mcap"
        with Program("loopback", "--record", path, "--json", "-") as program:
            telemetry = {side: program.engaged(side) for side in ("master", "slave")}
            recorder = program.recorder()
            sleep(0.3)
            if victim == "daemon":
                os.kill(telemetry["slave"].pid, signal.SIGKILL)
                status, output, _ = program.finish()
                assert (status, document(output)["recording"]["outcome"]) == (1, "complete")
            else:
                program.send(signal.SIGKILL)
                until(
                    lambda: not Path(f"/proc/{recorder}").exists() or status_of(recorder) == b"Z", "the recorder to end"
                )
            last = {side: each.records[-1] for side, each in telemetry.items()}
        recording = read_recording(path)
        assert recording.complete
        for side, record in last.items():
            assert recording.records[side][-1].tobytes() == record.tobytes()

    def test_two_hosts_files_make_one_session(self, tmp_path):
        port = free_port()
        address = ["--set", f"link.listen=127.0.0.1:{port}", "--set", f"link.slave=127.0.0.1:{port}"]
        files = {side: tmp_path / f"{side}.mcap" for side in ("master", "slave")}
        with (
            Program("slave", LOOPBACK, *address, "--record", files["slave"]) as slave,
            Program("master", LOOPBACK, *address, "--duration", 1.5, "--record", files["master"]) as master,
        ):
            assert master.finish()[0] == 0
            slave.send(signal.SIGTERM)
            slave.finish()
        alone, both = info(files["master"]), info(files["master"], files["slave"])
        assert alone["force"]["error_rms"] is None
        assert both["force"]["error_rms"] > 0.0
        # On one host the true offset between the clocks is 0, so the join can be checked against it.
        apart = [read_recording(path) for path in files.values()]
        joined = put_together(apart)
        own = apart[1].records["slave"]
        moved = joined.slave["at"] - own["at"][np.isin(own["tick"], joined.slave["tick"])]
        engaged = joined.slave["state"] == ENGAGED
        assert engaged.sum() > 300
        assert np.abs(moved[engaged]).max() < 0.02
        assert np.median(np.abs(moved[engaged])) < 1e-3


def test_files_of_two_sessions_are_not_joined(simulated, tmp_path):
    recording = read_recording(simulated[0])

    def only(side: str, later: float) -> Recording:
        records = recording.records[side].copy()
        records["at"] += later
        return Recording(
            recording.path, recording.facts, {side: recording.origins[side]}, {side: records}, True, {}, "complete"
        )

    joined = put_together([only("master", 0.0), only("slave", 50.0)])
    assert np.allclose(joined.slave["at"][100:], recording.records["slave"]["at"][100:], atol=1e-6)
    foreign = only("slave", 0.0)
    foreign.records["slave"]["peer_at"] += 100.0
    with pytest.raises(RecordingError, match="no time in common"):
        put_together([only("master", 0.0), foreign])
    deaf = only("slave", 0.0)
    deaf.records["slave"]["peer_at"] = np.nan
    with pytest.raises(RecordingError, match="never heard the master"):
        put_together([only("master", 0.0), deaf])


def test_sessions_of_two_masters_are_told_apart(simulated):
    recording = read_recording(simulated[0])
    once = recording.records["slave"]
    again = once.copy()
    again["at"] += 100.0  # peer_at counts from the tick 0 of the operator who came later
    for name in COUNTERS:
        again[name] += once[name][-1]

    def only(side: str, records: np.ndarray) -> Recording:
        origins = {side: recording.origins[side]}
        return Recording(recording.path, recording.facts, origins, {side: records}, True, {}, "complete")

    first = recording.records["master"]
    second = first.copy()
    second["at"] += 100.0
    whole_day = np.concatenate([once, again])
    alone = put_together([only("master", first), only("slave", once)]).summary()
    for master in (first, second):
        found = put_together([only("master", master), only("slave", whole_day)]).summary()
        for key in ("force", "position", "link", "energy"):
            assert numbers(found[key]) == pytest.approx(numbers(alone[key]), rel=1e-6, abs=1e-9), key
    never = first.copy()
    never["at"] += 50.0
    with pytest.raises(RecordingError, match="holds 2 sessions, none of them"):
        put_together([only("master", never), only("slave", whole_day)])


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda records: records["raw"].__setitem__((5, 0), np.nan), "position or force"),
        (lambda records: records["at"].__setitem__(5, np.nan), "time"),
        (lambda records: records["at"].__setitem__(-1, 1e15), "time"),
        (lambda records: records["selected"].__setitem__(5, 99), "number of a predictor"),
        (lambda records: records["fault"].__setitem__(5, 99), "number of a fault"),
    ],
)
def test_what_no_recorder_writes_is_said_in_one_line(simulated, tmp_path, change, complaint):
    records = read_recording(simulated[0]).records["slave"].copy()
    change(records)
    path = tmp_path / "odd.mcap"
    with RecordingWriter.create(path, read_recording(simulated[0]).facts) as writer:
        writer.add_side(Origin("slave", 1000.0, 0.0, 0.0))
        writer.write("slave", records)
    status, output, errors = weberlink("record", "info", path)
    one_line(status, errors, "odd.mcap", complaint)
    assert output == ""


def test_a_recording_that_lost_records_is_not_whole(simulated, tmp_path):
    path = tmp_path / "lossy.mcap"
    whole = read_recording(simulated[0])
    with RecordingWriter.create(path, whole.facts) as writer:
        writer.add_side(whole.origins["slave"])
        writer.write("slave", whole.records["slave"][500:])
        writer.note_lost("slave", 500)
    found = info(path)
    assert (found["outcome"], found["files"][0]["complete"]) == ("not whole", False)
    _, output, _ = weberlink("record", "info", path)
    assert "not whole, 500 records lost" in " ".join(output.split())


@pytest.mark.parametrize("command", [("record", "info"), ("record", "export", "--to", "csv"), ("study", "evaluate")])
def test_a_pipe_is_refused_without_waiting(tmp_path, command):
    pipe = tmp_path / "pipe.mcap"
    os.mkfifo(pipe)
    status, _, errors = weberlink(*command, pipe)
    one_line(status, errors, "no regular file")


def test_a_failed_export_leaves_no_table(simulated, small_disk):
    status, _, errors = weberlink("record", "export", simulated[0], "--to", "csv", "--out", small_disk)
    assert status == 1 and "No space left" in errors and errors.count("\n") == 1
    assert list(small_disk.iterdir()) == []


def test_the_status_line_says_when_the_recorder_is_gone():
    figures = dict.fromkeys(("packets_per_s", "reduction", "error_rms"))
    summary = {"duration_s": 1.0, "force": figures, "link": {"rtt_us": {"p50": None}}}
    assert "RECORDING" not in status_line({}, summary)
    assert "RECORDING" not in status_line({}, summary | {"recording": {"running": True}})
    assert "NOT RECORDING" in status_line({}, summary | {"recording": {"running": False}})


def test_tables_of_arms_have_a_column_per_joint(tmp_path):
    ticks = arm_sessions.records("slave", 200)
    path = arm_sessions.recording(tmp_path / "arms.mcap", {"slave": ticks})
    for to in ("csv", "parquet"):
        status, _, errors = weberlink("record", "export", path, "--to", to)
        assert (status, errors) == (0, "")
    with (tmp_path / "arms-slave.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    table = pytest.importorskip("pyarrow.parquet").read_table(tmp_path / "arms-slave.parquet")
    for name in ("joint_position", "joint_raw", "joint_output"):
        for place, joint in enumerate(JOINTS):
            written = np.array([float(row[f"{name}_{joint}"]) for row in rows], np.float32)
            assert (written == ticks[name][:, place]).all()
            assert (table[f"{name}_{joint}"].to_numpy() == ticks[name][:, place]).all()


def test_recording_of_arms_is_no_trace(tmp_path):
    path = arm_sessions.recording(tmp_path / "arms.mcap", {"slave": arm_sessions.records("slave", 300)})
    status, _, errors = weberlink("study", "evaluate", path, "--predictor", "zoh")
    one_line(status, errors, "arms.mcap", "expected a session in Cartesian space")
    weberlink("record", "export", path, "--to", "csv")
    assert [each.name for each in tmp_path.glob("*.csv")] == ["arms-slave.csv"]


def write_with_fields(path: Path, whole: Recording, fields: list[Field]) -> None:
    """The same recording as a release with these fields would write it."""
    others = {field.name for field in FIELDS} - {field.name for field in fields}
    text = "\n".join(line for line in SCHEMA_TEXT.split("\n") if not any(f" {name} " in line for name in others))
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start("ros2", "weberlink")
        writer.add_metadata("weberlink", whole.facts)
        schema = writer.register_schema(SCHEMA_NAME, "ros2msg", text.encode())
        for side, records in whole.records.items():
            origin = whole.origins[side]
            channel = writer.register_channel(origin.topic, "cdr", schema, origin.to_metadata())
            old = np.zeros(len(records), dtype_of(text))
            for name in old.dtype.names:
                old[name] = records[name]
            for index, record in enumerate(old):
                writer.add_message(channel, index, ENCAPSULATION + record.tobytes(), index, index)
        writer.add_metadata("end", {"outcome": "complete"})
        writer.finish()


def test_recording_from_before_arms_still_reads(simulated, tmp_path):
    whole = read_recording(simulated[0])
    path = tmp_path / "touch.mcap"
    write_with_fields(path, whole, [field for field in FIELDS if field.name not in ADDED])
    assert not set(ADDED) & set(read_recording(path).records["slave"].dtype.names)
    now, then = info(simulated[0]), info(path)
    assert {key: then[key] for key in now if key not in ("files", "ways")} == {
        key: now[key] for key in now if key not in ("files", "ways")
    }
    assert then["ways"]["to_slave"] == now["ways"]["to_slave"], "from fields that were always there"
    assert then["ways"]["jitter_us"] == {"p50": None, "p99": None}
    for to in ("csv", "ros", "lerobot"):
        status, _, errors = weberlink("record", "export", path, "--to", to)
        assert (status, errors) == (0, "")
    again = read_recording(tmp_path / "touch-ros.mcap").records["slave"]
    for name in again.dtype.names:
        expected = whole.records["slave"][name] if ADDED.get(name, 0.0) == 0.0 else np.full(len(again), np.nan)
        np.testing.assert_array_equal(again[name], expected)
    status, _, errors = weberlink("study", "evaluate", path, "--predictor", "zoh", "--json", "-")
    assert (status, errors) == (0, "")


def status_of(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return b"Z"
