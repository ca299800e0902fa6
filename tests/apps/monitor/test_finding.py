"""Rings by launcher."""

from pathlib import Path

from weberlink.apps.monitor.finding import find


def test_rings_are_paired_by_launcher_and_the_newest_is_last(tmp_path: Path) -> None:
    for name in (
        "weberlink-7-master.ring",
        "weberlink-7-slave.ring",
        "weberlink-7-slave.json",
        "weberlink-12-slave.ring",
        "weberlink-12-slave.ring.x8d2",
        "weberlink-x-slave.ring",
        "weberlink-9-other.ring",
        "another.ring",
    ):
        (tmp_path / name).touch()
    found = find(tmp_path)
    assert {name: sorted(rings) for name, rings in found.items()} == {"7": ["master", "slave"], "12": ["slave"]}
    assert found["12"]["slave"].path == tmp_path / "weberlink-12-slave.ring"
    assert found["12"]["slave"].number == (tmp_path / "weberlink-12-slave.ring").stat().st_ino
    assert find(tmp_path / "missing") == {}
