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
LOOPBACK = CONFIGS / "loopback.yaml"
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


# --- wrong arguments

EVALUATE = ["study", "evaluate", OPERATOR]
LAN, ARM, HELD = CONFIGS / "lan.yaml", CONFIGS / "phantom-arm.yaml", "master.device={driver: force_dimension}"
WRONG: list[tuple[list[object], str]] = [
    (["loopback", "--duration", "three"], "--duration"),
    (["simulate", LOOPBACK, "--duration", "inf"], "--duration"),
    ([*EVALUATE, "--floor", "inf"], "--floor"),
    ([*EVALUATE, "--floor", "-1"], "--floor"),
    ([*EVALUATE, "--workers", "0"], "--workers"),
    ([*EVALUATE, "--predictor=spline"], "--predictor: 'spline' is none of zoh, linear, plane, sphere, affine"),
    ([*EVALUATE, "--predictor=zoh,"], "--predictor: '' is none of"),
    ([*EVALUATE, "--predictor=zoh,plane, zoh"], "--predictor: zoh is listed twice"),
    ([*EVALUATE, "--weber=1.5"], "--weber: must be 0 to 1, not 1.5"),
    ([*EVALUATE, "--weber=-0.1"], "--weber: must be 0 to 1, not -0.1"),
    ([*EVALUATE, "--weber=nan"], "--weber: must be 0 to 1, not nan"),
    ([*EVALUATE, "--weber=ten"], "--weber: must be numbers with commas between them, not 'ten'"),
    ([*EVALUATE, "--weber=0.1,0.2,0.10"], "--weber: 0.1 is listed twice"),
    ([*EVALUATE, "--jnd=0"], "--jnd: must be above 0 and at most 1, not 0"),
    ([*EVALUATE, "--jnd=nan"], "--jnd: must be above 0 and at most 1, not nan"),
    (["study", "evaluate", "none.csv"], "none.csv: not found"),
    # Newcomers' mistakes.
    (["loopbak"], "did you mean loopback?"),
    (["loopback", "--durations", 3], "did you mean --duration?"),
    (["simulate"], "Missing argument 'FILE'"),
    (["loopback", "--duration", "nan"], "--duration"),
    (["simulate", LOOPBACK, "--duration", -1], "--duration"),
    *(
        (["check", LOOPBACK, "--set", override], field)
        for override, field in (
            ("codec.force.webber=1", "codec.force.webber: unknown key; did you mean weber?"),
            ("codec.force.predictor=hybird", "did you mean hybrid?"),
            ("lnk=1", "did you mean link?"),
            ("master.limits.force_n=1.0e+9", "master.limits.force_n"),
            ("master.device.driver=operater", "nearest is 'operator'"),
            ("link.slave=nowhere", "link.slave"),
            ("link.slave=::1:47000", "[::1]:47000"),
        )
    ),
    (["check", "none.yaml"], "no such file"),
    (["check", "."], "is a folder"),
    (["study", "experiment", LOOPBACK, "--out", "study"], "add --simulate"),
    (["simulate", LOOPBACK, "--json", "/sys/out.json"], "--json: /sys"),
    (["loopback", "--record", "none/a.mcap"], "none is not a folder"),
    (["simulate", LOOPBACK, "--trace", "."], "--trace"),
    (["loopback", "--record", "a" * 300], "give a shorter name"),
    # Standard output is for --json and --log.
    (["simulate", CONFIGS / "fig6.yaml", *AT_ONCE, "--trace", "-"], "--trace: - is standard output"),
    (["simulate", CONFIGS / "fig6.yaml", *AT_ONCE, "--record", "-"], "--record: - is standard output"),
    (["study", "ratings", CONFIGS, "--csv", "-"], "--csv: - is standard output"),
    ([*EVALUATE, "--plots", "-"], "--plots: - is standard output"),
    (["keygen", "-"], "out: - is standard output"),
    (["keygen", "none/c.key"], "out: none is not a folder"),
    # Files that a command cannot run.
    (["simulate", ARM], "weberlink device emulate polhem_serial"),
    (["simulate", ARM, "--set", HELD], "master.device.driver: force_dimension is a hardware driver"),
    (["simulate", CONFIGS / "ros2.yaml"], "ros2 is led by another program"),
    (["check", CONFIGS / "fig6.yaml", "--set", "codec.force.step_n=0.0001"], "codec.force.step_n"),
    (["check", CONFIGS / "fig6.yaml", "--set", "codec.position.step_m=1e-7"], "codec.position.step_m"),
    (["master", LOOPBACK, *AT_ONCE], "link.slave: port 0 is for loopback"),
    (["slave", LOOPBACK, *AT_ONCE], "link.listen: port 0 is for loopback"),
    # Pages and bridges, before anything is opened.
    (["try", "--scene", "moon"], "--scene moon: no such scene; there are dome, plane"),
    (["try", "mine.yaml", "--scene", "dome"], "--scene"),
    *((["try", "--listen", address], f"--listen {address}") for address in ("0.0.0.0", "::", "192.0.2.1")),
    (["bridge", "foxglove", "--listen", "0.0.0.0"], "--listen 0.0.0.0"),
    (["bridge", "ros2", "--domain", "233"], "domain is 0 to 232, got 233"),
    (["bridge", "ros2", "--connect", "localhost"], "endpoint is like tcp/192.168.1.5:7447, got 'localhost'"),
    (["bridge", "ros2", "--rate", "inf"], "--rate"),
    (["bridge", "ros2", "--depth", "0"], "--depth"),
    (["doctor", "--link", "robot"], "--link: needs a FILE"),
    (["doctor", "--set", "rate_hz=500"], "--set: needs a FILE"),
    (["doctor", "none.yaml"], "none.yaml"),
    (["doctor", LAN, "--set", "rate_hz=x"], "rate_hz"),
    (["doctor", LAN, "--side", "both"], "--side"),
    (["doctor", LAN, "--link", "robot", "--set", "link.key_file=none.key"], "link.key_file"),
    (["doctor", CONFIGS / "anywhere.yaml", "--link", "nobody", "--set", "link.peer_store=."], "nobody"),
    (["peer", "--remove"], "--remove"),
    (["configs", "--out", "a.yaml"], "--out"),
]


@pytest.mark.parametrize(("arguments", "field"), WRONG, ids=lambda value: value if isinstance(value, str) else "")
def test_a_wrong_argument_is_one_line_that_names_it(
    arguments: list[object], field: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert field in complaint(run(*arguments))
    assert not list(tmp_path.iterdir()), "nothing is written"


@pytest.mark.parametrize(
    ("arguments", "variables", "field"),
    [
        (["bridge", "ros2"], {"ROS_DOMAIN_ID": "-1"}, "got -1"),
        (["bridge", "ros2"], {"ZENOH_SESSION_CONFIG_URI": "/none.json5"}, "none.json5"),
        (["try", "--listen", "192.0.2.1", "--public"], {}, "--listen 192.0.2.1"),
    ],
)
def test_a_wrong_environment_is_one_line_that_names_it(
    arguments: list[str], variables: dict[str, str], field: str
) -> None:
    result = CliRunner().invoke(app, arguments, env=variables)
    assert field in complaint(result, 2 if "got" in field else 1)


# --- check


@pytest.mark.parametrize("name", FILES)
def test_check_says_what_a_shipped_file_composes(name: str, key: Path) -> None:
    result = run("check", CONFIGS / name, *with_key(key))
    assert (result.exit_code, result.stderr) == (0, "")
    first, *lines = result.stdout.splitlines()
    assert f"{name}: valid" in first
    assert max(map(len, lines)) <= 80
    said = [line for line in lines if line.startswith("warning")]
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


@pytest.mark.parametrize(("content", "problem"), [(b"\xff\xfe\x00", "it is not text"), (b"", "is empty")])
def test_a_file_that_is_no_yaml_is_one_line(content: bytes, problem: str, tmp_path: Path) -> None:
    file = tmp_path / "system.yaml"
    file.write_bytes(content)
    line = complaint(run("check", file))
    assert str(file) in line
    assert problem in line


def test_a_key_open_to_others_is_one_line(tmp_path: Path) -> None:
    run("keygen", tmp_path / "open.key")
    (tmp_path / "open.key").chmod(0o644)
    assert "chmod 600" in complaint(run("check", LAN, *with_key(tmp_path / "open.key")))


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


# --- simulate


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


def test_a_simulation_without_a_tick_is_no_failure(tmp_path: Path) -> None:
    result = run("simulate", CONFIGS / "loopback.yaml", "--duration", 0, "--trace", tmp_path / "trace.csv")
    assert result.exit_code == 0
    assert (tmp_path / "trace.csv").read_text().splitlines()[:1] == [HEADER]


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
    assert table.read_text().startswith("trace,channel,predictor,weber,")


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
