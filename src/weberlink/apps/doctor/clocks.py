"""The clocks that a tick depends on, and the one that it does not."""

from collections.abc import Iterator

from weberlink.apps.doctor.finding import Check, Finding, advice, ok, problem
from weberlink.apps.doctor.host import Host
from weberlink.apps.doctor.needs import Needs

SOURCES = "/sys/devices/system/clocksource/clocksource0"
SLOW = {"hpet", "acpi_pm", "jiffies", "refined-jiffies", "pit"}
"""Read over a bus, or no finer than the kernel's tick; a daemon reads the clock several times in a tick."""


def clock_source(host: Host, _needs: Needs) -> Iterator[Finding]:
    """What the kernel reads the time from."""
    current = host.read(f"{SOURCES}/current_clocksource")
    if current not in SLOW:
        yield ok("clock source", f"clock source {current}")
        return
    available = host.read(f"{SOURCES}/available_clocksource").split()
    better = next((name for name in available if name not in SLOW), None)
    if better is None:
        fix = "see why the kernel gave up the TSC: sudo dmesg | grep -iE 'tsc|clocksource'"
    else:
        at_once = f"echo {better} | sudo tee {SOURCES}/current_clocksource"
        fix = f"{at_once}    (to keep: kernel parameter clocksource={better})"
    yield problem("clock source", f"clock source {current}: every look at the time is slow", fix)


def wall_clock(host: Host, _needs: Needs) -> Iterator[Finding]:
    """Whether something keeps the wall clock right: only logs and recordings are dated by it."""
    if host.clock_is_synchronised():
        yield ok("wall clock", "wall clock synchronised")
    else:
        yield advice(
            "wall clock",
            "wall clock not synchronised; only logs and recordings are dated by it",
            "sudo timedatectl set-ntp true    (needs systemd-timesyncd or chrony)",
        )


CHECKS: tuple[Check, ...] = (clock_source, wall_clock)
