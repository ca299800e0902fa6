"""Checks of software and devices: Python, uvloop, extras, drivers and what is plugged in."""

import platform
import re
import sys
import sysconfig
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, requires, version

from weberlink.apps.devices import BROKEN, NO_EXTRA, NOTHING, READY, UNSEEN, DriverStatus, survey
from weberlink.apps.doctor.findings import Finding, advice, ok, problem
from weberlink.apps.doctor.machine import Machine
from weberlink.apps.doctor.needs import Needs
from weberlink.compiled import is_compiled
from weberlink.installation import pip_install

NOT_FOR_USERS = {"dev"}


def python(_machine: Machine, _needs: Needs) -> Finding:
    return judge_build(
        platform.python_version(),
        is_debug=bool(sysconfig.get_config_var("Py_DEBUG")),
        is_free_threaded=bool(sysconfig.get_config_var("Py_GIL_DISABLED")),
        is_dev_mode=sys.flags.dev_mode,
    )


def judge_build(number: str, *, is_debug: bool, is_free_threaded: bool, is_dev_mode: bool) -> Finding:
    """Warn of builds of Python that are slow or untested."""
    check = "Python"
    if is_debug:
        found = f"Python {number} is a debug build, several times slower"
        return problem(found, "use a release build of Python", check)
    if is_dev_mode:
        found = f"Python {number} in development mode, which is slow"
        return advice(found, "unset PYTHONDEVMODE; run without -X dev", check)
    if is_free_threaded:
        found = f"Python {number} is a free-threaded build, which is untested"
        return advice(found, "use the ordinary build of Python", check)
    return ok(f"Python {number}", check)


def compiled(_machine: Machine, _needs: Needs) -> Finding:
    return ok("weberlink is compiled" if is_compiled() else "weberlink is not compiled: a tick takes longer", "build")


def uvloop(_machine: Machine, _needs: Needs) -> Finding:
    number = _version("uvloop")
    if number is None:
        return problem("uvloop is not installed", f"{pip_install()} uvloop")
    return ok(f"uvloop {number}")


def extras(_machine: Machine, _needs: Needs) -> Finding:
    """Which optional extras are installed; loading a file that needs one reports it."""
    names = optional()
    missing = [name for name in sorted(names) if not all(_version(package) for package in names[name])]
    if missing:
        return ok(f"optional extras not installed: {', '.join(missing)}")
    return ok(f"all {len(names)} optional extras are installed")


def optional(project: str = "weberlink") -> dict[str, list[str]]:
    """The extras of a project and their packages."""
    found: dict[str, list[str]] = {}
    for line in requires(project) or []:
        name = re.match(r"[\w.-]+", line)
        extra = re.search(r"""extra\s*==\s*["']([\w-]+)["']""", line)
        if name and extra and extra[1] not in NOT_FOR_USERS:
            found.setdefault(extra[1], []).append(name[0])
    return found


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def devices(_machine: Machine, needs: Needs) -> Iterator[Finding]:
    """State of the drivers that the file names, and of other devices plugged in."""
    yield from judge_drivers(survey().drivers, needs)


def judge_drivers(drivers: Sequence[DriverStatus], needs: Needs) -> Iterator[Finding]:
    """Findings on the result of `weberlink device list`."""
    named = dict(needs.drivers)
    others = 0
    for each in drivers:
        if named.get(each.side) == each.driver:
            yield _named(each)
        elif each.plugged:
            others += 1
            found = f"{each.driver} at {', '.join(device.path for device in each.plugged)}: {each.state}"
            if each.advice and each.state not in (NO_EXTRA, BROKEN):
                yield advice(found, each.advice[0], "device")
            else:
                yield ok(found, "device")
    if not others:
        yield ok(f"nothing {'else ' if named else ''}plugged in that a driver knows")


def _named(status: DriverStatus) -> Finding:
    """The finding on a driver that the file names."""
    name, check = f"{status.side} {status.driver}", "driver"
    if status.state == READY:
        where = f" at {status.plugged[0].path}" if status.plugged else f", {status.kind}"
        return (
            advice(f"{name}{where}", status.advice[0], check) if status.advice else ok(f"{name}{where}: ready", check)
        )
    if status.state == UNSEEN:
        return ok(f"{name}: cannot be listed; to try it: weberlink device test {status.driver}", check)
    if status.state == NOTHING:
        return problem(
            f"{name}: no such device plugged in", "plug it in and switch it on, then: weberlink device list", check
        )
    return problem(f"{name}: {status.state}", status.advice[0] if status.advice else "weberlink device list", check)
