"""The shipped recordings: their archives, names and licences, and the conversions that make them from the sources."""

from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.master.trace import read_trace
from weberlink.studies import recordings
from weberlink.studies.recordings import archive
from weberlink.studies.recordings.catalogue import DATA
from weberlink.studies.recordings.convert import main

MOST_BYTES = 3_000_000
"""All archives together; they are part of the wheel."""

decimals = st.decimals(min_value=-1000, max_value=1000, allow_nan=False, allow_infinity=False, places=11).map(str)


@examples(30)
@given(rows=st.lists(st.lists(decimals, min_size=7, max_size=7), min_size=1, max_size=20))
def test_an_archive_keeps_every_digit(rows: list[list[str]], tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("archive") / "some.npz"
    archive.write(path, {"a": rows, "b": rows[:1]})
    assert archive.names(path) == ["a", "b"]
    assert archive.read(path, "a").tolist() == [[float(cell) for cell in row] for row in rows]
    assert archive.read(path, "b").shape == (1, 7)


def test_a_number_of_too_many_digits_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="digits"):
        archive.write(tmp_path / "some.npz", {"a": [["1.23456789012345678"] * 7]})


def test_equal_tables_give_equal_files(tmp_path: Path) -> None:
    rows = [[str(Decimal(row) / 8)] * 7 for row in range(9)]
    for name in ("one", "other"):
        archive.write(tmp_path / name, {"a": rows})
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()


@pytest.mark.parametrize("name", recordings.names())
def test_a_recording_is_a_signal_in_si_units(name: str) -> None:
    trace = recordings.load(name)
    assert recordings.source_of(name).name == name.rstrip("0123456789").rpartition("_")[0].removesuffix(
        "".join(f"_{what}" for what in ("rigid", "foam", "spring", "free") if f"_{what}_" in name)
    )
    assert 4.0 < trace.duration_s < 25.0
    assert 0.99e-3 < trace.period_s < 5.1e-3
    assert np.ptp(trace.position_m, axis=0).max() < 1.0
    assert 0.05 < np.abs(trace.force_n).max() < 100.0
    assert not len(trace.gaps_s) or name.startswith("panda")


def test_names_are_different_and_unknown_ones_are_refused() -> None:
    listed = recordings.names()
    assert len(set(listed)) == len(listed) == 41
    with pytest.raises(KeyError, match="no shipped recording"):
        recordings.load("tue_rigid_99")


def test_archives_are_small_and_have_their_licence_and_source() -> None:
    assert sum(source.archive.stat().st_size for source in recordings.SOURCES.values()) < MOST_BYTES
    page, licence = (DATA / "README.md").read_text(encoding="utf-8"), (DATA / "MIT.txt").read_text(encoding="utf-8")
    for source in recordings.SOURCES.values():
        count = len(source.recordings())
        assert f"| `{source.archive.name}` | {count} | {source.repository} | {source.licence} |" in page
        assert source.licence == "Apache-2.0" or f"for {source.archive.name}" in licence
    assert {path.name for path in DATA.iterdir()} == {
        "README.md", "MIT.txt", *(source.archive.name for source in recordings.SOURCES.values())
    }  # fmt: skip


# --- conversion, of checkouts as the sources document them


def omega3(checkout: Path, name: str) -> str:
    """Text of every second sample, with memory of something else behind the last."""
    trace = recordings.load(name)
    folder = checkout / "Data_Analysis/01_Implementation/user_study/01"
    folder.mkdir(parents=True)
    position = " ".join(f"{value:.10g}" for value in trace.position_m[::2].ravel())
    (folder / "Some_vsds_1_hd_real.txt").write_text(position + "  9.88131e-324  4.36964e+242  2.61384e-141  ")
    np.savetxt(folder / "Some_vsds_1_control_force.txt", trace.force_n[::2, 1:], "%.10g")
    return name


def ochoa_polish(checkout: Path, name: str) -> str:
    trace = recordings.load(name)
    path = checkout / "franka_polishing/mold_data/pattern"
    path.parent.mkdir(parents=True)
    other = np.zeros((len(trace.time_s), 1))
    rows = np.hstack((trace.time_s[:, None] + 1e-3, trace.position_m, *[other] * 7, -trace.force_n))
    np.savetxt(path, rows, "%.10g", header=" t p_x p_y p_z ...\n s m m m ...", comments="")
    return name


def stroke_iiwa_teleop(checkout: Path, name: str) -> str:
    trace = recordings.load(name)
    path = checkout / "Data/Parkour/RobotData_Circle.bin"
    path.parent.mkdir(parents=True)
    rows = np.zeros((len(trace.time_s), 45))
    rows[:, 0], rows[:, 1:4], rows[:, 7:10] = trace.time_s, trace.force_n, trace.position_m
    rows.tofile(path)
    return name


def panda_comanip(checkout: Path, name: str) -> str:
    """Lost samples repeat the position before them."""
    savemat = pytest.importorskip("scipy.io").savemat
    trace = recordings.load(name)
    at = np.round(trace.time_s * 1e3).astype(int)
    held = np.searchsorted(at, np.arange(at[-1] + 1), side="right") - 1
    path = checkout / "Panda_CoManipulation_Data/04/symbol_data.mat"
    path.parent.mkdir(parents=True)
    one = {"pos": trace.position_m[held].T, "vel": np.zeros((3, len(held))), "F": trace.force_n[held].T}
    savemat(path, {"symbol_data": np.array([one, one])})
    return name


def tue(checkout: Path, name: str) -> str:
    savemat = pytest.importorskip("scipy.io").savemat
    trace = recordings.load(name)
    path = checkout / "m1_question1/question1a_rigid.mat"
    path.parent.mkdir(parents=True)
    twice = [np.repeat(along, 2) for along in (trace.position_m[:, 2], 0.3 - trace.force_n[:, 2])]
    signals = [{"values": values[:, None]} for values in (twice[0], 0.0 * twice[0], twice[1])]
    savemat(path, {"scope": {"time": np.arange(len(twice[0])) * 5e-4, "signals": signals}})
    return name


@pytest.mark.parametrize("made", [omega3, ochoa_polish, stroke_iiwa_teleop, panda_comanip, tue])
def test_a_checkout_is_converted_and_recognised(made, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = made.__name__
    name = made(tmp_path / "checkout", recordings.names(source)[0])
    status = main([source, str(tmp_path / "checkout"), "--out", str(tmp_path / "out")])
    told = capsys.readouterr()
    assert f": {name}, forces differ by up to" in told.out
    assert status == 1
    assert name not in told.err.split(": ")[-1].split(", ")
    converted, shipped = read_trace(tmp_path / "out" / f"{name}.csv"), recordings.load(name)
    count = min(len(converted.time_s), len(shipped.time_s))
    assert count >= len(shipped.time_s) - 2
    assert converted.time_s[:count] == pytest.approx(shipped.time_s[:count], abs=1e-9)
    assert converted.position_m[:count] == pytest.approx(shipped.position_m[:count], abs=1e-7)
    offset = np.median(shipped.force_n[:, 2]) if source == "tue" else 0.0
    assert converted.force_n[:count] == pytest.approx(shipped.force_n[:count] - [0.0, 0.0, offset], abs=1e-5)


def test_an_unknown_file_is_converted_and_said_not_to_be_shipped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "franka_polishing/mold_data/pattern"
    path.parent.mkdir(parents=True)
    np.savetxt(path, np.arange(42.0).reshape(3, 14), header="t\ns", comments="")
    assert main(["ochoa_polish", str(tmp_path)]) == 1
    assert "franka_polishing/mold_data/pattern: 3 samples, not shipped" in capsys.readouterr().out
