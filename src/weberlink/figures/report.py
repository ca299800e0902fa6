"""The report at the end of a run and the status line during it, from the figures of the JSON, in 80 columns.

docs/glossary.md defines its words.
"""

from collections.abc import Iterator
from math import pi
from textwrap import wrap
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from weberlink.figures.environment import footer
from weberlink.figures.link_report import link_lines
from weberlink.figures.paths import finding
from weberlink.figures.verdict import DEGRADED, FAILED_OUTCOME, FAILURE, GOOD, felt_channel, millijoules, verdict
from weberlink.order import MASTER
from weberlink.protocol.states import State
from weberlink.telemetry.record import RELEASED

WIDTH = 80
CHANNELS = (
    ("force", "N", 1.0, 3),
    ("torque", "mN m", 1e3, 1),
    ("position", "mm", 1e3, 3),
    ("orientation", "deg", 180.0 / pi, 2),
    ("joint_torque", "mN m", 1e3, 1),
    ("gripper_torque", "mN m", 1e3, 1),
    ("joint_angle", "deg", 180.0 / pi, 2),
    ("gripper_angle", "deg", 180.0 / pi, 2),
)
"""Name, displayed unit, factor from SI to it, digits."""

COLOURS = {GOOD: "green", DEGRADED: "yellow", FAILURE: "red"}
_WITHOUT_SESSION = (State.CONNECTING, State.LISTENING)
SHOWN_S = 1.0
"""Shorter times without a session are not shown: daemons do not start and end at the same moment [s]."""
STALE_S = 1.0
"""Age of the newest record at which the status line shows it [s]; a daemon writes one each tick."""


def session_report(summary: dict[str, Any], title: str, console: Console) -> None:
    """Print the report of a session: the verdict, then the figures that there are."""
    judged = verdict(summary)
    console.print(Text(judged.line, style=f"bold {COLOURS[judged.word]}"))
    outcome = summary["outcome"]
    is_told = outcome.startswith(FAILED_OUTCOME)  # by the verdict
    console.print(Text(f"{title}  {summary['duration_s']:.1f} s{'' if is_told else f'  {outcome}'}", style="bold"))
    if not any(ticks["count"] for ticks in summary["ticks"].values()):
        return  # no tick ran
    connected = any(side is not None and side["connected_s"] for side in summary["connection"].values())
    if connected:
        console.print(_channels(summary))
    console.print(_ticks(summary))
    for line in [*_host(summary), *_connection(summary), *_lines(summary, connected=connected)]:
        console.print(Text(line), soft_wrap=False)
    if "environment" in summary:
        console.print(Text(footer(summary["environment"], summary.get("seed")), style="dim"))


def status_line(records: dict[str, Any], summary: dict[str, Any]) -> str:
    """One line of a running session, at most 79 characters: what is wrong, then the state, then figures.

    Args:
        records: the newest record of each side; None before the first.
        summary: the figures so far; of the launcher's facts any may be missing.
    """
    present = {side: record for side, record in records.items() if record is not None}
    felt = felt_channel(summary)
    parts = [f"{summary['duration_s']:6.1f} s"]
    if not summary.get("recording", {"running": True}).get("running", False):
        parts.append("NOT RECORDING")
    parts += _stale(present, summary.get("record_age_s", {}))
    states = [_state(side, record, summary) for side, record in present.items()]
    parts.append(states[0] if states and all(each == states[0] for each in states) else "; ".join(states) or "starting")
    if not any(int(record["state"]) == State.ENGAGED.value for record in present.values()):
        return "  ".join(parts)[: WIDTH - 1]  # the figures are of a session that is over
    name, unit, factor, digits = _felt_units(summary)
    if felt["packets_per_s"] is not None and felt["reduction"] is not None:
        parts += [f"{name} {felt['packets_per_s']:.0f}/s", f"-{100 * felt['reduction']:.1f} %"]
    if felt["error_rms"] is not None:
        error = _number(felt["error_rms"], factor, unit, digits)
        parts += [f"felt {error}", f"outside {100 * felt['violation_fraction']:.1f} %"]
    if summary["link"]["rtt_us"]["p50"] is not None:
        parts.append(f"rtt {summary['link']['rtt_us']['p50'] / 1000:.2f} ms")
    return "  ".join(parts)[: WIDTH - 1]  # a full line would wrap


def _stale(present: dict[str, Any], ages: dict[str, float]) -> list[str]:
    """Sides whose telemetry has stopped."""
    return [f"no record of the {side} for {ages[side]:.0f} s" for side in present if ages.get(side, 0.0) >= STALE_S]


def _state(side: str, record: Any, summary: dict[str, Any]) -> str:
    """The state of a side in a few words, with the address or the name of its peer where that is another host."""
    state = State(int(record["state"]))
    if state is State.ENGAGED and int(record["ramping"]) == RELEASED:
        return "button released"
    addresses = summary.get("addresses", {})
    if state in _WITHOUT_SESSION and (note := finding(summary.get("paths", {}).get(side, ()))):
        return note
    if state is State.CONNECTING and addresses:
        return f"calling {addresses['slave']}"
    if state is State.LISTENING and addresses:
        return f"listening on {addresses['listen']}"
    word = state.name.lower()
    if len(summary.get("peers", {})) != 1 or state not in (State.ENGAGED, State.SILENT):
        return word
    known = addresses.get("slave" if side == MASTER else "listen", "the peer")
    name = (summary["peers"][side] or {}).get("name") or known
    return f"{word} with {name}" if state is State.ENGAGED else f"{name} silent"


def _channels(summary: dict[str, Any]) -> Table:
    gap = 2 if "force" in summary else 1  # the names of an arm's channels are longer
    table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0))
    table.add_column("channel", no_wrap=True)
    for name in ("packets/s", "fewer", "all fewer", "B/s", "error RMS", "max", "outside"):
        table.add_column(name, justify="right", no_wrap=True)
    for name, unit, factor, digits in CHANNELS:
        if name not in summary:
            continue
        channel = summary[name]
        if not channel["samples"]:
            table.add_row(name.replace("_", " "), "-", "-", "-", "-", "-", "-", "-")
            continue
        table.add_row(
            name.replace("_", " "),
            f"{channel['packets_per_s']:.1f}",
            _percent(channel["reduction"]),
            _percent(channel.get("reduction_all")),
            "-" if channel.get("bytes_per_s") is None else f"{channel['bytes_per_s']:.0f}",
            _number(channel["error_rms"], factor, unit, digits),
            _number(channel["error_max"], factor, unit, digits),
            _percent(channel["violation_fraction"]),
        )
    return table


def _ticks(summary: dict[str, Any]) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("side", no_wrap=True)
    for name in ("ticks", "missed", "late p50/p99 us", "work p50/p99 us", "codec p50/p99 us"):
        table.add_column(name, justify="right", no_wrap=True)
    for side, ticks in summary["ticks"].items():
        if not ticks["count"]:
            continue
        total = ticks["count"] + ticks["missed"]
        table.add_row(
            side,
            str(ticks["count"]),
            _percent(ticks["missed"] / total if total else None, 2),
            *(_pair(ticks[name]) for name in ("lateness_us", "work_us", "codec_us")),
        )
    return table


def _connection(summary: dict[str, Any]) -> Iterator[str]:
    """How long each side was in session with which peer, if not all the time."""
    for side, figures in summary["connection"].items():
        if figures is None:
            continue
        waits = (("waited", "waited_s"), ("unconnected", "unconnected_s"), ("peer away", "away_s"))
        parts = [f"{words} {figures[key]:.1f} s" for words, key in waits if figures[key] >= SHOWN_S]
        if parts:
            name = (summary.get("peers", {}).get(side) or {}).get("name")
            connected = f"connected to {name}" if name else "connected"
            yield ", ".join([f"{side}: {connected} {figures['connected_s']:.1f} s", *parts])


def _lines(summary: dict[str, Any], *, connected: bool) -> Iterator[str]:
    if connected:
        yield from _session(summary)
    link = summary["link"]
    yield (
        f"datagrams: {link['sent']} sent, {link['received']} received, {link['lost']} lost, "
        f"{link['dropped']} dropped, {link['repeats']} repeats"
    )
    if any(summary["drops"].values()):
        yield f"dropped: {_by_side(summary['drops'])}"
    if connected:
        yield from _energy(summary["energy"])
        yield from _limited(summary["limited"])
    yield f"faults: {_by_side(summary['faults']) or 'none'}"
    for side, grants in summary.get("realtime", {}).items():
        if grants is not None:
            yield f"{side}: {_rights(grants)}"
    if "recording" in summary:
        yield _recording(summary["recording"])
    if "run_time_s" in summary:
        yield f"run time {summary['run_time_s']:.2f} s, {summary['duration_s'] / summary['run_time_s']:.1f} x real time"


def _session(summary: dict[str, Any]) -> Iterator[str]:
    """Felt error, codec and delays."""
    felt = felt_channel(summary)
    yield from _felt(felt)
    yield from _aligned(summary, felt)
    yield from _quality(felt)
    if felt["coding"]["error_rms"] is not None:
        _, unit, factor, digits = _felt_units(summary)
        rms, most = (_number(felt["coding"][key], factor, unit, digits) for key in ("error_rms", "error_max"))
        yield f"coding error {rms} RMS, {most} max"
    if len(felt["selected"]) > 1:
        yield "sends by predictor: " + ", ".join(f"{name} {count}" for name, count in felt["selected"].items())
    yield from _axes(summary)
    yield from _widened(summary)
    yield from link_lines(summary)


def _felt_units(summary: dict[str, Any]) -> tuple[str, str, float, int]:
    """What the operator feels in a word, its displayed unit, the factor from SI to it, and digits."""
    felt = "force" if "force" in summary else "joint_torque"
    _, unit, factor, digits = next(entry for entry in CHANNELS if entry[0] == felt)
    return felt.rpartition("_")[2], unit, factor, digits


def _axes(summary: dict[str, Any]) -> Iterator[str]:
    """The felt error of each axis of an arm."""
    _, unit, factor, digits = _felt_units(summary)
    errors = [
        f"{axis} {figures['error_rms'] * factor:.{digits}f}"
        for channel in ("joint_torque", "gripper_torque")
        for axis, figures in summary.get(channel, {}).get("axes", {}).items()
        if figures is not None
    ]
    if errors:
        yield from wrap(f"error RMS by axis [{unit}]: {', '.join(errors)}", WIDTH)


def _energy(energy: dict[str, Any]) -> Iterator[str]:
    if energy["generated_j"] is None:
        return
    out, left = (millijoules(energy[key]) for key in ("generated_j", "dissipated_j"))
    share, bound = energy["bound_share"], energy["bound_j"]
    part = "" if share is None else f", {millijoules(bound)} allowed ({_percent(share, 0)} used)"
    yield f"energy at the hand: {out} out{part}; {left} dissipated"


def _host(summary: dict[str, Any]) -> Iterator[str]:
    """What the host of a live session took, and which missed ticks are its."""
    host = summary.get("host")
    if host is None:
        return
    if host["unknown"] is None:
        missed = sum(ticks["missed"] for ticks in summary["ticks"].values())
        line = f"host: {host['stalls']} stalls, longest {host['longest_ms']:.1f} ms"
        line += f"; {sum(host['missed'].values())} of {missed} missed ticks"
    else:
        line = f"host not watched: {host['unknown']}"
    yield f"{line}; steal {_percent(host['steal'], 2) if host['steal'] is not None else 'not counted'}"


def _felt(force: dict[str, Any]) -> Iterator[str]:
    if force["error_rms"] is not None:
        yield (
            f"{_percent(force['violation_fraction'])} of ticks outside the deadband "
            f"({_percent(force['violation_floor'])} explained by network delay)"
        )
        yield (
            f"outside: {force['violation_s']:.2f} s in total, longest {force['violation_longest_s'] * 1e3:.0f} ms; "
            f"error in deadbands {_ratio(force['error_p99_deadbands'])} p99, {_ratio(force['error_max_deadbands'])} max"
        )
    else:
        yield "felt error: unknown; needs both sides (loopback, simulate, or info on two recordings)"


def _aligned(summary: dict[str, Any], felt: dict[str, Any]) -> Iterator[str]:
    """The felt error, and what is left of it without the delay."""
    if felt["aligned_rms"] is not None:
        _, unit, factor, digits = _felt_units(summary)
        rms, aligned = (_number(felt[key], factor, unit, digits) for key in ("error_rms", "aligned_rms"))
        yield f"felt error {rms} RMS; {aligned} with the delay removed ({felt['aligned_lag_s'] * 1e3:.0f} ms)"


def _widened(summary: dict[str, Any]) -> Iterator[str]:
    """Channels whose rate of updates reached its bound, if any."""
    for name, unit, factor, digits in CHANNELS:
        if name in summary and summary[name]["widened_fraction"]:
            share, most = summary[name]["widened_fraction"], _number(summary[name]["widened_max"], factor, unit, digits)
            limit = "" if summary[name]["widened_max"] is None else f", to at most {most}"
            yield f"{name.replace('_', ' ')}: deadband widened in {_percent(share)} of ticks{limit}"


def _quality(force: dict[str, Any]) -> Iterator[str]:
    """Measures of the displayed force in JNDs of a person."""
    parts = []
    if force["error_rms_jnd"] is not None:
        parts.append(f"error {_ratio(force['error_rms_jnd'])} RMS, log error {_ratio(force['log_error_rms_jnd'])}")
    if force["jump_median_jnd"] is not None:
        jumps = (_ratio(force[f"jump_{which}_jnd"]) for which in ("median", "p99", "max"))
        parts.append("jumps {} median, {} p99, {} max".format(*jumps))
    if parts:
        yield f"in JND: {'; '.join(parts)}"


def _recording(facts: dict[str, Any]) -> str:
    """Path, size, completeness and cost of the recording."""
    line = f"recording: {facts['path']}, {facts['bytes'] / 1e6:.1f} MB"
    if "records" in facts:
        lost = sum(facts["lost"].values())
        line += f", {sum(facts['records'].values())} records, {lost} lost"
        if facts.get("elapsed_s"):
            line += f", {_percent(facts['cpu_s'] / facts['elapsed_s'])} of a core"
    return line if facts["outcome"] == "complete" else f"{line}; {facts['outcome']}"


def _limited(ticks: dict[str, int]) -> Iterator[str]:
    """Ticks in which a limit acted, if any."""
    if any(ticks.values()):
        yield (
            f"ticks at a limit: force {ticks['force_ticks']}, slew {ticks['slew_ticks']}, "
            f"robot {ticks['motion_ticks']}, contact {ticks['contact_ticks']}"
        )


def _by_side(counts: dict[str, dict[str, int]]) -> str:
    return ", ".join(f"{side} {name} {count}" for side, named in counts.items() for name, count in named.items())


def _rights(grants: dict[str, dict[str, Any]]) -> str:
    """Rights that the kernel granted or refused."""
    asked = {name: grant for name, grant in grants.items() if grant["detail"] != "not asked for"}
    return ", ".join(
        grant["detail"] if grant["granted"] else f"{name.replace('_', ' ')} {grant['detail']}"
        for name, grant in asked.items()
    )


def _percent(share: float | None, digits: int = 1) -> str:
    return "-" if share is None else f"{100 * share:.{digits}f} %"


def _number(value: float | None, factor: float, unit: str, digits: int = 3) -> str:
    return "-" if value is None else f"{value * factor:.{digits}f} {unit}"


def _ratio(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _pair(summary: dict[str, float | None]) -> str:
    return "-" if summary["p50"] is None else f"{summary['p50']:.0f}/{summary['p99']:.0f}"
