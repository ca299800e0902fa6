import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from weberlink.master.trace import COLUMNS, LARGEST_ARRAYS, Trace, TraceError, read_trace

HEADER = "t,px,py,pz,fx,fy,fz\n"
ZERO = "0,0,0,0,0,0,0\n"


def written(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def arrays(rows: int = 3, **changed: Any) -> dict[str, Any]:
    made = dict.fromkeys(COLUMNS, np.arange(rows) * 1.0) | changed
    return {name: value for name, value in made.items() if value is not None}


def test_columns_are_read_as_named_in_any_order_beside_others(tmp_path: Path) -> None:
    text = '\ufefffz, note,t,px,py,pz,fx,fy\n"6",7,0,1,2,3,4,5\n\n12,x,0.001,7,8,9,10,11\r\n'
    trace = read_trace(written(tmp_path / "a.csv", text))
    assert isinstance(trace, Trace)
    assert trace.time_s.tolist() == [0.0, 0.001]
    assert trace.position_m.tolist() == [[1.0, 2.0, 3.0], [7.0, 8.0, 9.0]]
    assert trace.force_n.tolist() == [[4.0, 5.0, 6.0], [10.0, 11.0, 12.0]]
    assert (trace.duration_s, trace.period_s) == (0.001, 0.001)


def test_an_npz_file_holds_an_array_for_each_column(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", **arrays(), other=np.zeros(2))
    trace = read_trace(tmp_path / "a.npz", np.array([1.0, 1e-3, 1e-3, 1e-3, 1.0, 1.0, 1.0]))
    assert trace.time_s.tolist() == [0.0, 1.0, 2.0]
    assert trace.position_m.tolist() == [[0.0] * 3, [1e-3] * 3, [2e-3] * 3]
    assert trace.force_n[2].tolist() == [2.0, 2.0, 2.0]


def test_a_small_npz_file_that_stands_for_a_large_one_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        file.writestr("t.npy", b"\x93NUMPY")
        file.infolist()[0].file_size = LARGEST_ARRAYS + 1  # what the directory states is what is unpacked at most
    with pytest.raises(TraceError, match="unpacks to more than"):
        read_trace(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "not found"),
        ("", "row 1: expected the header t,px,py,pz,fx,fy,fz, found nothing"),
        ("t,px,py,fx,fy\n1,2,3,4,5\n", "row 1: missing column pz, fz"),
        ("t,t,px,py,pz,fx,fy,fz\n", "row 1: column t appears more than once"),
        (HEADER + ZERO, "at least 2 rows of samples, found 1"),
        (HEADER + ZERO + "1,0,0,x,0,0,0\n", "row 3, column pz: expected a number, found 'x'"),
        (HEADER + ZERO + "\n1,0,,0,0,0,0\n", "row 4, column py: expected a number, found ''"),
        (HEADER + ZERO + "1,0,0,0,0,0\n", "row 3, column fz: expected a number, found only 6 values"),
        (HEADER + ZERO + "1,0,0,0,nan,0,0\n", "row 3, column fx: expected a finite number, found 'nan'"),
        (HEADER + ZERO + "\n" + ZERO, "row 4, column t: expected a time after 0, found 0"),
        (HEADER.encode() + b"0,0,0,0,0,0,0\n1,0,\xff,0,0,0,0\n", "expected a readable CSV file"),
        (arrays(px=None), "expected an npz file with arrays t,px,py,pz,fx,fy,fz of one length"),
        (arrays(px=np.array(["a", "b", "c"])), "of one length"),
        (arrays(fz=np.array([0.0, np.nan, 0.0])), "of finite numbers"),
        (arrays(rows=1), "at least 2 rows of samples, found 1"),
        (arrays(t=np.zeros(3)), "row 2, column t: expected a time after 0, found 0"),
        (os.mkfifo, "is no regular file"),
    ],
)
def test_invalid_trace_is_refused_in_one_line(tmp_path: Path, content: Any, expected: str) -> None:
    path = tmp_path / ("bad.npz" if isinstance(content, dict) else "bad.csv")
    if isinstance(content, dict):
        np.savez(path, **content)
    elif callable(content):
        content(path)
    elif content is not None:
        written(path, content)
    with pytest.raises(TraceError, match=r"\A[^\n]*\Z") as caught:
        read_trace(path)
    assert str(path) in str(caught.value) and expected in str(caught.value)


@given(content=st.binary(max_size=200), place=st.integers(0, 2000), value=st.integers(0, 255))
def test_any_bytes_give_trace_or_error(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, place: int, value: int
) -> None:
    folder = tmp_path_factory.mktemp("t")
    np.savez_compressed(folder / "a.npz", **arrays())
    torn = bytearray((folder / "a.npz").read_bytes())
    torn[place % len(torn)] = value
    for path in (written(folder / "a.npz", bytes(torn)), written(folder / "a.csv", HEADER.encode() + content)):
        try:
            trace = read_trace(path)
        except TraceError as error:
            assert "\n" not in str(error)
        else:
            assert len(trace.time_s) >= 2
