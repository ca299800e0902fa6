"""Swap, huge pages and the room for telemetry."""

from pathlib import Path

from tests.apps.doctor.machine import machine, only
from weberlink.apps.doctor import Grade, Needs
from weberlink.apps.doctor.memory import huge_pages, shared_memory, swap
from weberlink.telemetry.record import RECORD

AREA = "Filename\tType\tSize\tUsed\tPriority\n/dev/sda2  partition\t2000000\t0\t-2\n"


def test_swap_matters_where_memory_is_not_locked(tmp_path: Path) -> None:
    assert only(swap, machine(tmp_path), Needs(lock_memory=False)).grade is Grade.OK
    area = machine(tmp_path, {"proc/swaps": AREA})
    assert only(swap, area).grade is Grade.OK
    unlocked = only(swap, area, Needs(lock_memory=False))
    assert unlocked.grade is Grade.ADVICE
    assert "2048 MB" in unlocked.found


def test_huge_pages_always_are_advice(tmp_path: Path) -> None:
    path = "sys/kernel/mm/transparent_hugepage/enabled"
    assert only(huge_pages, machine(tmp_path)).grade is Grade.OK
    found = only(huge_pages, machine(tmp_path, {path: "[always] madvise never"}))
    assert (found.grade, found.fix) == (Grade.ADVICE, f"echo madvise | sudo tee /{path}")


def test_the_rings_of_the_sides_that_run_here_must_fit(tmp_path: Path) -> None:
    ring = 10 * 1000 * RECORD.size
    tight = machine(tmp_path, space=lambda _path: (64_000_000, int(1.5 * ring)))
    assert only(shared_memory, tight).grade is Grade.PROBLEM
    assert "remount" in (only(shared_memory, tight).fix or "")
    assert only(shared_memory, tight, Needs(sides=("slave",))).grade is Grade.OK
    assert only(shared_memory, tight, Needs(rate_hz=500.0)).grade is Grade.OK


def test_in_a_container_the_engine_is_told_the_size(tmp_path: Path) -> None:
    full = machine(tmp_path, {"run/.containerenv": ""}, space=lambda _path: (64_000_000, 0))
    assert "--shm-size" in (only(shared_memory, full).fix or "")


def test_a_machine_without_shared_memory_is_a_problem(tmp_path: Path) -> None:
    host = machine(tmp_path)
    (tmp_path / "dev/shm/.keep").unlink()
    (tmp_path / "dev/shm").rmdir()
    assert only(shared_memory, host).grade is Grade.PROBLEM
