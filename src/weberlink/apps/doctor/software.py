"""What runs the daemons: the interpreter, the event loop, the optional packages and the tools of `weberlink bench`."""

import platform
import re
import sys
import sysconfig
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, requires, version

from weberlink.apps.doctor.finding import Check, Finding, advice, ok, problem
from weberlink.apps.doctor.host import Host
from weberlink.apps.doctor.needs import Needs

TOOLS = {"cyclictest": "rt-tests", "sockperf": "sockperf"}
"""That `weberlink bench` compares with, and the Debian package of each."""
NOT_FOR_USERS = {"dev"}


def interpreter(_host: Host, _needs: Needs) -> Iterator[Finding]:
    """Builds of Python that are slow, or that nothing here was tried with."""
    yield judged_build(
        platform.python_version(),
        is_debug=bool(sysconfig.get_config_var("Py_DEBUG")),
        is_free_threaded=bool(sysconfig.get_config_var("Py_GIL_DISABLED")),
        is_dev_mode=sys.flags.dev_mode,
    )


def judged_build(number: str, *, is_debug: bool, is_free_threaded: bool, is_dev_mode: bool) -> Finding:
    """What to think of an interpreter."""
    if is_debug:
        return problem(
            "Python", f"Python {number} is a debug build, several times slower", "use a release build of Python"
        )
    if is_dev_mode:
        return advice(
            "Python", f"Python {number} in development mode, which is slow", "unset PYTHONDEVMODE; run without -X dev"
        )
    if is_free_threaded:
        return advice(
            "Python",
            f"Python {number} is a free-threaded build, which was not tried yet",
            "use the ordinary build of Python",
        )
    return ok("Python", f"Python {number}")


def event_loop(_host: Host, _needs: Needs) -> Iterator[Finding]:
    """The package that wakes up a tick."""
    number = _version("uvloop")
    if number is None:
        yield problem("uvloop", "uvloop is not installed", "pip install uvloop")
    else:
        yield ok("uvloop", f"uvloop {number}")


def extras(_host: Host, _needs: Needs) -> Iterator[Finding]:
    """Which optional parts are installed; a file that needs one says so itself."""
    names = optional()
    missing = [name for name in sorted(names) if not all(_version(package) for package in names[name])]
    if missing:
        yield ok("extras", f"optional extras not installed: {', '.join(missing)}")
    else:
        yield ok("extras", f"all {len(names)} optional extras are installed")


def optional(project: str = "weberlink") -> dict[str, list[str]]:
    """The extras of a project, and the packages that each of them brings."""
    found: dict[str, list[str]] = {}
    for line in requires(project) or []:
        name = re.match(r"[\w.-]+", line)
        extra = re.search(r"""extra\s*==\s*["']([\w-]+)["']""", line)
        if name and extra and extra[1] not in NOT_FOR_USERS:
            found.setdefault(extra[1], []).append(name[0])
    return found


def tools(host: Host, _needs: Needs) -> Iterator[Finding]:
    """What `weberlink bench` needs to show the limits of this machine."""
    missing = [name for name in TOOLS if host.which(name) is None]
    if missing:
        yield advice(
            "tools",
            f"not installed: {', '.join(missing)}; weberlink bench has less to compare with",
            f"sudo apt install {' '.join(TOOLS[name] for name in missing)}",
        )
    else:
        yield ok("tools", f"{' and '.join(TOOLS)} are there, for weberlink bench")


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


CHECKS: tuple[Check, ...] = (interpreter, event_loop, extras, tools)
