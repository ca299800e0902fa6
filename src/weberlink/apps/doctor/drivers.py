"""Devices and robots: what the file names must be there, what else is plugged in should be usable."""

from collections.abc import Iterator, Sequence

from weberlink.apps.devices import BROKEN, NO_EXTRA, NOTHING, READY, Row, survey
from weberlink.apps.doctor.finding import Check, Finding, advice, ok, problem
from weberlink.apps.doctor.host import Host
from weberlink.apps.doctor.needs import Needs


def devices(_host: Host, needs: Needs) -> Iterator[Finding]:
    """What `weberlink devices` says, of what matters here."""
    yield from judged(survey().rows, needs)


def judged(rows: Sequence[Row], needs: Needs) -> Iterator[Finding]:
    """The findings of a survey."""
    named = dict(needs.drivers)
    others = 0
    for row in rows:
        if named.get(row.side) == row.driver:
            yield _wanted(row)
        elif row.plugged:
            yield from _plugged(row)
            others += 1
    if not others:
        yield ok(
            "devices",
            "nothing else plugged in that a driver knows" if named else "nothing plugged in that a driver knows",
        )


def _wanted(row: Row) -> Finding:
    name = f"{row.side} {row.driver}"
    if row.state == READY:
        where = f" at {row.plugged[0].path}" if row.plugged else f", {row.kind}"
        return (
            advice("driver", f"{name}{where}", row.advice[0]) if row.advice else ok("driver", f"{name}{where}: ready")
        )
    if row.state == NOTHING:
        return problem(
            "driver",
            f"{name}: nothing plugged in that it knows",
            "plug it in and switch it on, then: weberlink devices",
        )
    fix = row.advice[0] if row.advice else "weberlink devices"
    return problem("driver", f"{name}: {row.state}", fix)


def _plugged(row: Row) -> Iterator[Finding]:
    """Something that the file does not name."""
    where = ", ".join(each.path for each in row.plugged)
    if row.advice and row.state not in (NO_EXTRA, BROKEN):
        yield advice("device", f"{row.driver} at {where}: {row.state}", row.advice[0])
    else:
        yield ok("device", f"{row.driver} at {where}: {row.state}")


CHECKS: tuple[Check, ...] = (devices,)
