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
    table: Registry[Any] = Registry("driver", {}, "weberlink.test_drivers")
    error = raised(lambda: table["late"]().act(acme.fail))
    line = PARTS.splitlines().index('    raise ValueError("two\\nlines")') + 1
    assert fault_of(error) == (f"driver fault: late of acme-parts: ValueError: two lines (parts.py:{line})", True)
    # The base class has no name of its own, and code of others that the part calls counts as the part's.
    assert fault_of(raised(lambda: table["late"]().act(lambda: {}["x"]))) is not None


def test_a_part_derived_from_one_that_is_built_in_is_named_itself(acme: Any) -> None:
    table: Registry[Any] = Registry("driver", {"plain": acme.Driver}, "weberlink.test_drivers")
    table.load("plain")
    told = fault_of(raised(lambda: table["late"]().act(acme.fail)))
    assert told is not None and told.text.startswith("driver fault: late of acme-parts: ") and told.is_foreign


def test_code_beside_a_part_counts_where_no_part_runs(acme: Any) -> None:
    table: Registry[Any] = Registry("scheme", {}, "weberlink.test_schemes")
    table.load("scheme")
    told = fault_of(raised(acme.fail))
    assert told is not None
    assert " of acme-parts: ValueError: two lines (parts.py:" in told.text


def test_built_in_part_is_named_without_a_distribution() -> None:
    table: Registry[Any] = Registry("own", {"driver": OwnDriver})
    driver = table["driver"]()
    told = fault_of(raised(driver.act))
    assert told is not None
    assert told.text.startswith("own fault: driver: KeyError: 'x' (test_registry.py:")
    assert not told.is_foreign


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
