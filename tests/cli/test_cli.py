"""What the commands print, write and return, for good arguments and for bad ones."""

import json
import os
import re
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.main import get_command
from typer.testing import CliRunner, Result

from tests.system.systems import CONFIGS, UNUSABLE
from weberlink.cli import app
from weberlink.installation import install_line
from weberlink.master.trace import read_trace
from weberlink.system.configuration import load
from weberlink.system.simulate import simulate

FILES = sorted({path.name for path in CONFIGS.glob("*.yaml")} - set(UNUSABLE))
HARDWARE = ("franka.yaml", "koch-so101.yaml", "phantom-arm.yaml")
"""Those whose drivers need hardware or its emulator."""
BETWEEN_HOSTS = ("koch-so101.yaml", "lan.yaml")
"""Those in which the master calls another host."""
LED = ("ros2.yaml",)
"""Those that another program leads."""
OPERATOR = CONFIGS / "traces" / "operator.npz"
HEADER = "t,px,py,pz,fx,fy,fz"
COMMANDS = get_command(app).commands  # type: ignore[attr-defined]
MEMBERS = [f"{name} {member}" for name, group in COMMANDS.items() for member in getattr(group, "commands", ())]


LIVE = ("master", "slave", "loopback")
AT_ONCE = ("--duration", 0)
"""So that a live command that takes what it should refuse ends all the same."""


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


def complaint(result: Result, status: int = 2) -> str:
    """The one line on standard error of a command that printed nothing else."""
    assert result.exit_code == status, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1, result.stderr
    return lines[0]


@pytest.fixture(scope="module")
def key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cli") / "weberlink.key"
    assert run("keygen", path).exit_code == 0
    return path


def with_key(key: Path) -> tuple[str, ...]:
    """For files that need a key; the others do not look at it."""
    return "--set", f"link.key_file={key}"


# --- help


@pytest.mark.parametrize("command", ["", *COMMANDS, *MEMBERS])
def test_every_command_explains_itself(command: str) -> None:
    result = run(*command.split(), "--help")
    assert result.exit_code == 0
    assert result.stdout.startswith("Usage: ")
    assert result.stderr == ""


def test_help_lists_commands_by_topic() -> None:
    text = run("-h").stdout
    assert text == run("--help").stdout == run().stdout
    assert max(map(len, text.splitlines())) <= 80
    assert "..." not in text.partition("\n\n")[2], "every command has a sentence that fits"
    topics = [line for line in text.splitlines() if re.fullmatch(r"[A-Z]\w+:", line)]
    assert topics == ["Options:", "Run:", "Look:", "Setup:", "Study:"]
    listed = text.partition("Run:")[2].splitlines()
    assert len([line for line in listed if line.startswith("  ")]) <= 16


def test_completion_knows_commands() -> None:
    asked = {"_WEBERLINK_COMPLETE": "complete_bash", "COMP_WORDS": "weberlink lo", "COMP_CWORD": "1"}
    ended = subprocess.run(
        [sys.executable, "-c", "from weberlink.cli import main; main()"],
        env=os.environ | asked, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (ended.stdout.split(), ended.stderr) == (["loopback"], "")


@pytest.mark.parametrize(
    "arguments",
    [
        ["loopback", "--duration", "three"],
        ["simulate", CONFIGS / "loopback.yaml", "--duration", "inf"],
        ["study", "evaluate", OPERATOR, "--floor", "inf"],
        ["study", "evaluate", OPERATOR, "--floor", "-1"],
        ["study", "evaluate", OPERATOR, "--workers", "0"],
    ],
    ids=lambda arguments: " ".join(str(argument).rpartition("/")[2] for argument in arguments),
)
def test_wrong_arguments_are_one_line(arguments: list[object]) -> None:
    complaint(run(*arguments))


# --- check


@pytest.mark.parametrize("name", FILES)
def test_check_says_what_a_shipped_file_composes(name: str, key: Path) -> None:
    result = run("check", CONFIGS / name, *with_key(key))
    assert (result.exit_code, result.stderr) == (0, "")
    assert f"{name}: valid" in result.stdout.splitlines()[0]
    said = [line for line in result.stdout.splitlines() if line.startswith("warning")]
    # The address of the robot is for the reader to put in.
    placed = [line for line in said if line.startswith("warning   link.slave 192.0.2.1:47000: ")]
    assert len(placed) == (name in BETWEEN_HOSTS)
    # The drivers of hardware say what is uncertain of it.
    others = [line for line in said if line not in placed]
    assert all(line.startswith(("warning   master.device: ", "warning   slave.robot: ")) for line in others)
    assert not others or name in HARDWARE
    channels = 4 if "\nrotation " in result.stdout or "\ngripper " in result.stdout else 2
    assert len(re.findall(r"update of \d+.* bytes of UDP payload", result.stdout)) == channels


def update_sizes(key: Path, *arguments: str) -> list[list[int]]:
    """Of the force and of the position channel: without history, and with it."""
    output = run("check", CONFIGS / "loopback.yaml", *with_key(key), *arguments).stdout
    return [[int(size) for size in re.findall(r"\d+", line)] for line in re.findall(r"update of (.*) bytes", output)]


def test_fewer_axes_fewer_predictors_and_no_crypto_are_shorter_updates(key: Path) -> None:
    none = ("--set", "control.scheme=none")
    three = update_sizes(key, *none)
    one = update_sizes(key, *none, "--set", "axes=z")
    assert all(a < b for sizes in zip(one, three, strict=True) for a, b in zip(*sizes, strict=True))
    assert update_sizes(key, *none, "--set", "codec.force.predictor=zoh")[0][-1] < three[0][-1]
    secured = update_sizes(key, *none, "--set", "link.security=psk")
    assert all(a < b for sizes in zip(three, secured, strict=True) for a, b in zip(*sizes, strict=True))
    assert secured[0][1] <= 50
    assert three[0][0] <= 32


@pytest.mark.parametrize("command", ["check", "simulate", *LIVE])
def test_every_command_that_takes_a_file_complains_alike(command: str, tmp_path: Path) -> None:
    at_once = AT_ONCE if command in LIVE else ()
    file = CONFIGS / "loopback.yaml"
    line = complaint(run(command, file, *at_once, "--set", "slave.limits.spead_m_s=1"))
    assert line == f"weberlink: {file}: slave.limits.spead_m_s: unknown key; did you mean speed_m_s?"
    assert "no such file" in complaint(run(command, tmp_path / "none.yaml", *at_once))


@pytest.mark.parametrize("command", ["check", "simulate", *LIVE])
def test_a_missing_key_is_one_line_with_file_and_field(command: str, tmp_path: Path) -> None:
    missing = tmp_path / "none.key"
    at_once = AT_ONCE if command in LIVE else ()
    line = complaint(run(command, CONFIGS / "lan.yaml", *at_once, "--set", f"link.key_file={missing}"))
    assert line.startswith(f"weberlink: {CONFIGS / 'lan.yaml'}: link.key_file: {missing} does not exist")


# --- keygen


def test_keygen_writes_a_private_file_and_never_over_another(tmp_path: Path) -> None:
    path = tmp_path / "a.key"
    assert run("keygen", path).exit_code == 0
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    content = path.read_bytes()
    assert "exists already" in complaint(run("keygen", path))
    assert path.read_bytes() == content
    assert run("keygen", tmp_path / "b.key").exit_code == 0
    assert (tmp_path / "b.key").read_bytes() != content
    assert "cannot be written" in complaint(run("keygen", tmp_path / "none" / "c.key"))


# --- simulate


def test_simulate_refuses_hardware_drivers() -> None:
    line = complaint(run("simulate", CONFIGS / "phantom-arm.yaml"))
    assert "master.device.driver: polhem_serial is a hardware driver" in line
    assert "weberlink device emulate polhem_serial" in line
    line = complaint(run("simulate", CONFIGS / "phantom-arm.yaml", "--set", "master.device={driver: force_dimension}"))
    assert line.endswith("run it live"), "nothing emulates a library"


def test_simulate_refuses_drivers_led_by_programs() -> None:
    assert "ros2 is led by another program" in complaint(run("simulate", CONFIGS / "ros2.yaml"))


@pytest.mark.parametrize("name", [name for name in FILES if name not in HARDWARE + LED])
def test_simulate_completes_every_shipped_file(name: str, key: Path) -> None:
    result = run("simulate", CONFIGS / name, "--duration", 2, "--json", "-", *with_key(key))
    assert result.exit_code == 0
    assert all(
        line.startswith("weberlink: note: ") or " s, after " in line for line in result.stderr.splitlines()
    )  # the progress of a slow machine
    summary = json.loads(result.stdout)
    assert summary["outcome"] == "completed"
    assert summary["faults"] == {"master": {}, "slave": {}}
    assert summary["ticks"]["slave"]["count"] >= 2000
    assert summary["position" if "position" in summary else "joint_angle"]["packets"] > 0


def test_two_simulations_differ_in_run_time_only() -> None:
    faults = [argument for name in ("loss=0.1", "jitter_ms=3") for argument in ("--set", f"link.emulate.{name}")]
    documents = []
    for _ in range(2):
        document = json.loads(run("simulate", CONFIGS / "fig6.yaml", "--duration", 2, "--json", "-", *faults).stdout)
        assert document.pop("run_time_s") > 0.0
        documents.append(json.dumps(document))
    assert documents[0] == documents[1]


def test_a_simulated_trace_can_be_evaluated(tmp_path: Path) -> None:
    trace = tmp_path / "trace.csv"
    result = run("simulate", CONFIGS / "scene-plane.yaml", "--duration", 2, "--trace", trace)
    assert (result.exit_code, result.stderr) == (0, "")
    assert max(map(len, result.stdout.splitlines())) <= 80
    assert rows_of(run("study", "evaluate", trace, "--predictor", "zoh", "--json", "-"))[0]["packets"] > 0


@pytest.mark.parametrize("rate_hz", [1000, 4000, 7000])
def test_a_trace_of_any_rate_is_the_signal_to_the_last_digit(rate_hz: int, tmp_path: Path) -> None:
    path, settings = tmp_path / "trace.csv", [f"rate_hz={rate_hz}"]
    result = run("simulate", CONFIGS / "scene-plane.yaml", "--duration", 1, "--trace", path, "--set", *settings)
    assert result.exit_code == 0
    read, made = read_trace(path), simulate(load(CONFIGS / "scene-plane.yaml", settings), 1.0)[1].trace
    for name in ("time_s", "position_m", "force_n"):
        assert getattr(read, name).tolist() == getattr(made, name).tolist()
    assert np.abs(made.force_n).max() > 0.1


@pytest.mark.parametrize(
    "arguments",
    [
        ("simulate", CONFIGS / "fig6.yaml", "--trace"),
        ("simulate", CONFIGS / "fig6.yaml", "--record"),
        ("study", "ratings", CONFIGS, "--csv"),
        ("study", "evaluate", OPERATOR, "--plots"),
    ],
    ids=lambda arguments: arguments[-1],
)
def test_only_json_and_log_go_to_standard_output(arguments: tuple[object, ...]) -> None:
    duration = AT_ONCE if arguments[0] == "simulate" else ()
    assert f"weberlink: {arguments[-1]}: - is standard output" in complaint(run(*arguments, "-", *duration))
    assert not Path("-").exists()


def test_a_simulation_without_a_tick_is_no_failure(tmp_path: Path) -> None:
    result = run("simulate", CONFIGS / "loopback.yaml", "--duration", 0, "--trace", tmp_path / "trace.csv")
    assert result.exit_code == 0
    assert (tmp_path / "trace.csv").read_text().splitlines()[:1] == [HEADER]


@pytest.mark.parametrize(
    ("key", "value", "part"),
    [
        ("codec.force.step_n", 0.0001, "slave.robot reports up to"),
        ("codec.position.step_m", 1e-7, "master.device reaches"),
    ],
)
def test_a_wire_that_cannot_say_what_a_part_measures_is_refused(key: str, value: float, part: str) -> None:
    line = complaint(run("check", CONFIGS / "fig6.yaml", "--set", f"{key}={value}"))
    assert key in line
    assert part in line
    assert "use a step of at least" in line


# --- one side alone


@pytest.mark.parametrize(("side", "field"), [("master", "link.slave"), ("slave", "link.listen")])
def test_one_side_alone_needs_a_port_that_the_other_knows(side: str, field: str) -> None:
    assert f"{field}: port 0 is for loopback" in complaint(run(side, CONFIGS / "loopback.yaml", *AT_ONCE))


# --- evaluate


def rows_of(result: Result) -> list[dict[str, Any]]:
    assert (result.exit_code, result.stderr) == (0, "")
    rows = json.loads(result.stdout)["rows"]
    assert isinstance(rows, list)
    return rows


def test_evaluate_prints_a_table_in_80_columns() -> None:
    result = run("study", "evaluate", OPERATOR, "--weber", "0.1,0.2")
    assert (result.exit_code, result.stderr) == (0, "")
    lines = result.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    named = [line.split()[:3] for line in lines if line.startswith("operator ")]
    assert named == [["operator", p, k] for p in ("zoh", "linear", "plane", "sphere", "hybrid") for k in ("0.1", "0.2")]


def test_evaluate_gives_the_documented_figures() -> None:
    rows = rows_of(
        run("study", "evaluate", OPERATOR, "--predictor", "zoh,hybrid", "--weber", "0.05,0.2", "--json", "-")
    )
    keys = {
        "trace": str,
        "predictor": str,
        "weber": float,
        "samples": int,
        "packets": int,
        "packets_per_s": float,
        "reduction": float,
        "error_rms_n": float,
        "error_max_n": float,
        "error_max_deadbands": float,
        "tick_us": float,
        "bytes_per_s": float,
        "violation_fraction": float,
        "violation_longest_s": float,
        "error_rms_jnd": float,
        "error_max_jnd": float,
        "noticeable_fraction": float,
        "noticeable_longest_s": float,
    }
    for row in rows:
        assert {name: type(row[name]) for name in keys} == keys
        assert row["reduction"] == pytest.approx(1.0 - row["packets"] / row["samples"])
        assert ("selected" in row) == (row["predictor"] == "hybrid")
    packets = {(row["predictor"], row["weber"]): row["packets"] for row in rows}
    assert packets["zoh", 0.2] < packets["zoh", 0.05]
    assert packets["hybrid", 0.05] < packets["zoh", 0.05]


def test_evaluate_writes_json_csv_and_plots_beside_the_table(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    out, table, plots = tmp_path / "out.json", tmp_path / "out.csv", tmp_path / "new" / "plots"
    result = run("study", "evaluate", OPERATOR, "--predictor", "zoh", "--json", out, "--csv", table, "--plots", plots)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.startswith("trace")
    assert len(json.loads(out.read_text())["rows"]) == 1
    assert (plots / "packet_rate.png").read_bytes().startswith(b"\x89PNG")
    assert table.read_text().startswith("trace,predictor,weber,")


def test_without_matplotlib_plots_are_refused_in_one_line_and_nothing_else_needs_it(tmp_path: Path) -> None:
    program = "import sys; sys.modules['matplotlib'] = None; from weberlink.cli import main; main()"

    def evaluated(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", program, "study", "evaluate", OPERATOR, "--predictor", "zoh", *arguments]
        return subprocess.run(
            list(map(str, command)), cwd=CONFIGS.parent, capture_output=True, text=True, timeout=60, check=False
        )

    refused = evaluated("--plots", tmp_path)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.splitlines() == [
        f"weberlink: --plots: needs matplotlib; install it with: {install_line('studies')}"
    ]
    assert evaluated().returncode == 0


ROWS = ["0.000,0,0,0,0,0,0", "0.001,0,0,0,0,0,1", "0.002,0,0,0,0,0,1"]


@pytest.mark.parametrize(
    ("lines", "row", "problem"),
    [
        (["t,px,py,fx,fy,fz", "0,0,0,0,0,0"], "row 1", "missing column pz"),
        ([HEADER, ROWS[0], ROWS[2], ROWS[1]], "row 4", "column t"),
        ([HEADER, *ROWS[:2], "0.002,0,0,0,nan,0,1"], "row 4", "column fx"),
        ([HEADER, ROWS[0], "0.001,0,0,0,0"], "row 3", "column fy"),
        ([HEADER, ROWS[0], "0.001,0,zero,0,0,0,0"], "row 3", "column py"),
        ([], "row 1", "expected the header"),
        ([HEADER], "rows", "found none"),
    ],
    ids=["missing column", "unsorted", "NaN", "short row", "no number", "empty", "no samples"],
)
def test_a_bad_trace_is_one_line_with_file_and_row(tmp_path: Path, lines: list[str], row: str, problem: str) -> None:
    trace = tmp_path / "trace.csv"
    trace.write_text("\n".join(lines))
    line = complaint(run("study", "evaluate", OPERATOR, trace))
    assert line.startswith(f"weberlink: {trace}: ")
    assert row in line
    assert problem in line


def test_a_trace_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    assert complaint(run("study", "evaluate", tmp_path / "none.csv")).startswith(
        f"weberlink: {tmp_path / 'none.csv'}: not found; "
    )


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        ("--predictor", "spline", "'spline' is none of zoh, linear, plane, sphere, affine, surface,"),
        ("--predictor", "zoh,", "'' is none of"),
        ("--weber", "1.5", "must be 0 to 1, not 1.5"),
        ("--weber", "-0.1", "must be 0 to 1, not -0.1"),
        ("--weber", "nan", "must be 0 to 1, not nan"),
        ("--weber", "ten", "must be numbers with commas between them, not 'ten'"),
        ("--weber", "0.1,0.2,0.10", "0.1 is listed twice"),
        ("--predictor", "zoh,plane, zoh", "zoh is listed twice"),
        ("--jnd", "0", "must be above 0 and at most 1, not 0"),
        ("--jnd", "nan", "must be above 0 and at most 1, not nan"),
    ],
)
def test_an_option_out_of_range_is_one_line(option: str, value: str, expected: str) -> None:
    line = complaint(run("study", "evaluate", OPERATOR, f"{option}={value}"))
    assert line.startswith(f"weberlink: {option}: ")
    assert expected in line


# --- where nothing can be written


def test_figures_that_cannot_be_written_are_not_lost() -> None:
    for arguments in (
        ["study", "evaluate", OPERATOR, "--predictor", "zoh"],
        ["simulate", CONFIGS / "fig6.yaml", "--duration", 1],
    ):
        result = run(*arguments, "--json", "/dev/full")  # which can be opened
        assert result.exit_code == 1
        text, _, complaint_ = result.stderr.rstrip("\n").rpartition("\n")
        assert {"rows", "outcome"} & set(json.loads(text))
        assert complaint_ == "weberlink: /dev/full: cannot be written: No space left on device"


def test_unwritable_trace_is_said_beside_figures() -> None:
    result = run("simulate", CONFIGS / "fig6.yaml", "--duration", 1, "--trace", "/dev/full", "--json", "-")
    assert result.exit_code == 1
    assert json.loads(result.stdout)["outcome"] == "completed"
    assert result.stderr.splitlines() == ["weberlink: /dev/full: cannot be written: No space left on device"]
