"""Whose fault an error is: a part by name is told by its methods, or by the code that comes with it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.session.packages import install
from weberlink.registry import PartError, Registry, fault_of

PARTS = """
class Driver:
    def act(self, deed):
        return deed()


class Late(Driver):
    pass


class Helper:
    def help(self):
        return 1 / 0


def fail():
    raise ValueError("two\\nlines")
"""
ENTRY_POINTS = """
[weberlink.test_drivers]
late = acme.parts:Late
[weberlink.test_schemes]
scheme = acme.parts:Helper
"""


class OwnDriver:
    def act(self) -> None:
        raise KeyError("x")


@pytest.fixture
def acme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A package of another distribution."""
    (tmp_path / "acme").mkdir()
    install(tmp_path, "acme-parts", {"acme/__init__": "", "acme/parts": PARTS}, ENTRY_POINTS)
    monkeypatch.syspath_prepend(str(tmp_path))
    from acme import parts  # type: ignore[import-not-found]  # noqa: PLC0415

    return parts


def raised(deed: Callable[[], object]) -> Exception:
    with pytest.raises(Exception) as caught:
        deed()
    return caught.value


def test_error_of_a_part_names_kind_distribution_error_and_line(acme: Any) -> None:
    table: Registry[Any] = Registry("driver", {"plain": acme.Driver}, "weberlink.test_drivers")
    table.load("plain")  # the base of the other one
    line = PARTS.splitlines().index('    raise ValueError("two\\nlines")') + 1
    told = fault_of(raised(lambda: table["late"]().act(acme.fail)))
    assert told == (f"driver fault: late of acme-parts: ValueError: two lines (parts.py:{line})", True)


def test_code_that_a_part_calls_and_code_beside_one_count_as_the_part_s(acme: Any) -> None:
    drivers: Registry[Any] = Registry("driver", {}, "weberlink.test_drivers")
    assert fault_of(raised(lambda: drivers["late"]().act(lambda: {}["x"]))) is not None
    schemes: Registry[Any] = Registry("scheme", {}, "weberlink.test_schemes")
    schemes.load("scheme")
    told = fault_of(raised(acme.fail))
    assert told is not None and " of acme-parts: ValueError: two lines (parts.py:" in told.text


def test_built_in_part_is_named_without_a_distribution() -> None:
    told = fault_of(raised(Registry[Any]("own", {"driver": OwnDriver})["driver"]().act))
    assert told is not None and not told.is_foreign
    assert told.text.startswith("own fault: driver: KeyError: 'x' (test_registry.py:")


def test_other_errors_are_nobody_s_fault() -> None:
    assert fault_of(raised(lambda: 1 / 0)) is None
    assert fault_of(ValueError("never raised")) is None


def test_part_error_has_what_the_module_raised_as_its_cause(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, "bad-parts", {"bad_parts": "1 / 0"}, "[weberlink.test_bad]\nbad = bad_parts:Part")
    monkeypatch.syspath_prepend(str(tmp_path))
    table: Registry[Any] = Registry("driver", {}, "weberlink.test_bad")
    with pytest.raises(PartError) as caught:
        table.load("bad")
    assert str(caught.value).startswith("driver bad of bad-parts: bad_parts:Part cannot be imported: ZeroDivisionError")
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
