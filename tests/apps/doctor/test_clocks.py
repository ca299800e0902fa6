"""What the kernel reads the time from, and the wall clock."""

from pathlib import Path

import pytest

from tests.apps.doctor.machine import CLOCK, machine, only
from weberlink.apps.doctor import Grade
from weberlink.apps.doctor.clocks import clock_source, wall_clock


@pytest.mark.parametrize("name", ["tsc", "kvm-clock", "hyperv_clocksource_tsc_page", "arch_sys_counter", "xen"])
def test_clocks_of_processors_and_of_virtual_machines_are_fine(tmp_path: Path, name: str) -> None:
    assert only(clock_source, machine(tmp_path, {f"{CLOCK}/current_clocksource": name})).grade is Grade.OK


@pytest.mark.parametrize("name", ["hpet", "acpi_pm"])
def test_a_slow_clock_is_a_problem_that_names_a_better_one(tmp_path: Path, name: str) -> None:
    found = only(clock_source, machine(tmp_path, {f"{CLOCK}/current_clocksource": name}))
    assert found.grade is Grade.PROBLEM
    assert (found.fix or "").startswith(f"echo tsc | sudo tee /{CLOCK}/current_clocksource ")


def test_without_a_better_clock_the_kernel_is_asked_why(tmp_path: Path) -> None:
    files = {f"{CLOCK}/current_clocksource": "hpet", f"{CLOCK}/available_clocksource": "hpet acpi_pm"}
    assert "dmesg" in (only(clock_source, machine(tmp_path, files)).fix or "")


def test_a_wall_clock_that_nobody_sets_is_no_more_than_advice(tmp_path: Path) -> None:
    assert only(wall_clock, machine(tmp_path)).grade is Grade.OK
    assert only(wall_clock, machine(tmp_path, clock_is_synchronised=lambda: False)).grade is Grade.ADVICE
