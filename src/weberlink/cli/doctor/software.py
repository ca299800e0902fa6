"""Software and devices: Python, uvloop, extras, drivers and what is plugged in."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from weberlink.cli.devices import BROKEN, NO_EXTRA, NOTHING, READY, UNSEEN, DriverStatus
from weberlink.cli.doctor.machine import Machine
from weberlink.cli.doctor.needs import Needs
from weberlink.cli.doctor.report import Finding, advice, ok, problem
from weberlink.installation import all_guests, pip_install


def python(build: Mapping[str, Any], _needs: Needs) -> Finding:
    """Warn of builds of Python that are slow or untested."""
    name = f"Python {build['number']}"
    if build["is_debug"]:
        return problem(f"{name} is a debug build, several times slower", "use a release build of Python")
    if build["is_dev_mode"]:
        return advice(f"{name} in development mode, which is slow", "unset PYTHONDEVMODE; run without -X dev")
    if build["is_free_threaded"]:
        return advice(f"{name} is a free-threaded build, which is untested", "use the ordinary build of Python")
    return ok(name)


def compiled(is_compiled: bool, _needs: Needs) -> Finding:
    return ok("weberlink is compiled" if is_compiled else "weberlink is not compiled: a tick takes longer")


def uvloop(machine: Machine, _needs: Needs) -> Finding:
    number = machine.version("uvloop")
    return ok(f"uvloop {number}") if number else problem("uvloop is not installed", f"{pip_install()} uvloop")


def guests(machine: Machine, _needs: Needs) -> Finding:
    """Which guests are installed; what needs another one names it."""
    known = all_guests()
    missing = [name for name in sorted(known) if machine.version(f"weberlink-{name}") is None]
    if missing:
        return ok(f"guests not installed: {', '.join(missing)}")
    return ok(f"all {len(known)} guests are installed")


def devices(drivers: Sequence[DriverStatus], needs: Needs) -> Iterator[Finding]:
    """State of the drivers that the file names, and of other devices plugged in."""
    named = dict(needs.drivers)
    others = 0
    for each in drivers:
        if named.get(each.side) == each.driver:
            yield _named(each)
        elif each.plugged:
            others += 1
            found = f"{each.driver} at {', '.join(device.path for device in each.plugged)}: {each.state}"
            helps = each.advice and each.state not in (NO_EXTRA, BROKEN)
            yield advice(found, each.advice[0], "device") if helps else ok(found, "device")
    if not others:
        yield ok(f"nothing {'else ' if named else ''}plugged in that a driver knows")


def _named(status: DriverStatus) -> Finding:
    """The finding on a driver that the file names."""
    name, check = f"{status.side} {status.driver}", "driver"
    first = next(iter(status.advice), None)
    if status.state == READY:
        name += f" at {status.plugged[0].path}" if status.plugged else f", {status.kind}"
        return advice(name, first, check) if first else ok(f"{name}: ready", check)
    if status.state == UNSEEN:
        return ok(f"{name}: cannot be listed; to try it: weberlink device test {status.driver}", check)
    if status.state == NOTHING:
        fix = "plug it in and switch it on, then: weberlink device list"
        return problem(f"{name}: no such device plugged in", fix, check)
    return problem(f"{name}: {status.state}", first or "weberlink device list", check)
