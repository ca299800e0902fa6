"""The shipped file is valid, works at a distance as it is, and is copied with all that it names."""

from pathlib import Path

import pytest

from plugins.anywhere.tests import FILE
from tests.program import weberlink
from weberlink.cli.shipped import copy
from weberlink.config import ConfigurationError, load
from weberlink.session.simulation import simulate

HERE = ("link.finder=null", "link.listen=127.0.0.1:47000", "link.security=none")


def test_the_file_is_valid() -> None:
    ended = weberlink("check", FILE)
    assert (ended.status, "link      by anywhere" in ended.output) == (0, True)


def test_it_is_connected_from_start_to_end() -> None:
    figures, _ = simulate(load(FILE, (*HERE, "link.emulate={delay_ms: 100, jitter_ms: 5, loss: 0.02, seed: 1}")), 3.0)
    assert (figures.outcome, figures.faults) == ("completed", {"master": {}, "slave": {}})
    assert all(each is not None and each.interruptions == 0 for each in figures.connection.values())


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        (("mailbox=relay.example:4000",), "link.finder.mailbox: must be the address of a mailbox server"),
        (("mailbox=null",), "path ice needs mailbox"),
        (("turn={server: a:1}",), "link.finder.turn: needs secret_file or credentials_file"),
        (("path=direct", "paths=2"), "paths and interfaces need path: ice"),
    ],
)
def test_a_wrong_value_is_one_line(overrides: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(ConfigurationError, match=complaint):
        load(FILE, [f"link.finder.{each}" for each in overrides])


def test_a_copy_has_the_schema_beside_it(tmp_path: Path) -> None:
    assert {path.name for path in copy("anywhere", tmp_path)} == {"anywhere.yaml", "weberlink.schema.json"}
