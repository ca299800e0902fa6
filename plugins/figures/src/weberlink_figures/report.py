"""The report at the end of a run and the status line during it, from the figures of a session, in 80 columns.

docs/glossary.md defines its words.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from math import pi
from textwrap import wrap
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table
from rich.text import Text

from weberlink.order import MASTER
from weberlink.protocol.paths import LinkPath, finding
from weberlink.protocol.states import State
from weberlink.session.ending import FAILED_OUTCOME
from weberlink.telemetry.record import RELEASED
from weberlink_figures.environment import footer
from weberlink_figures.tree import DEGRADED, FAILURE, GOOD, Channel, Energy, Figures, Median, Quality, Ticks
from weberlink_figures.verdict import percent, verdict
from weberlink_figures.wording import class_words

WIDTH = 80


class Unit(NamedTuple):
    """How a quantity is shown: its unit, the factor from SI to it, and digits."""

    name: str
    factor: float
    digits: int

    def show(self, value: float | None) -> str:
        return "-" if value is None else f"{value * self.factor:.{self.digits}f} {self.name}"


_TORQUE, _ANGLE = Unit("mN m", 1e3, 1), Unit("deg", 180.0 / pi, 2)
UNITS = {
    "force": Unit("N", 1.0, 3),
    "torque": _TORQUE,
    "position": Unit("mm", 1e3, 3),
    "orientation": _ANGLE,
    "joint_torque": _TORQUE,
    "gripper_torque": _TORQUE,
    "joint_angle": _ANGLE,
    "gripper_angle": _ANGLE,
}
"""Of each channel, in the order of the report."""
CHANNEL_COLUMNS: dict[str, Callable[[Channel, Unit], str]] = {
    "packets/s": lambda channel, _: _shown(channel.packets_per_s, 1),
    "fewer": lambda channel, _: percent(channel.reduction),
    "all fewer": lambda channel, _: percent(channel.reduction_all),
    "B/s": lambda channel, _: _shown(channel.bytes_per_s, 0),
    "error RMS": lambda channel, unit: unit.show(channel.errors.error_rms),
    "max": lambda channel, unit: unit.show(channel.errors.error_max),
    "outside": lambda channel, _: percent(channel.errors.violation_fraction),
}
TICK_COLUMNS: dict[str, Callable[[Ticks], str]] = {
    "ticks": lambda ticks: str(ticks.count),
    "missed": lambda ticks: percent(ticks.missed / (ticks.count + ticks.missed), 2),
    "late p50/p99 us": lambda ticks: _pair(ticks.lateness_us),
    "work p50/p99 us": lambda ticks: _pair(ticks.work_us),
    "codec p50/p99 us": lambda ticks: _pair(ticks.codec_us),
}
WAITS = {"waited": "waited_s", "unconnected": "unconnected_s", "peer away": "away_s"}
COLOURS = {GOOD: "green", DEGRADED: "yellow", FAILURE: "red"}
SHOWN_S = 1.0  # shorter times without a session are not shown: daemons do not start and end at the same moment [s]
STALE_S = 1.0  # age of the newest record at which the status line shows it [s]; a daemon writes one each tick


def session_report(figures: Figures, title: str, console: Console, environment: dict[str, Any] | None = None) -> None:
    """Print the report of a session: the verdict, then the figures that there are."""
    judged, outcome = verdict(figures), figures.outcome or ""
    console.print(Text(judged.line, style=f"bold {COLOURS[judged.word]}"))
    is_told = outcome.startswith(FAILED_OUTCOME)  # by the verdict
    console.print(Text(f"{title}  {figures.duration_s:.1f} s{'' if is_told else f'  {outcome}'}", style="bold"))
    if not any(ticks.count for ticks in figures.ticks.values()):
        return  # no tick ran
    connected = any(side is not None and side.connected_s for side in figures.connection.values())
    if connected:
        table = _table("channel", CHANNEL_COLUMNS, 1 if figures.is_arm else 2)  # the names of an arm's are longer
        for name, unit in UNITS.items():
            if (channel := figures.channels.get(name)) is not None:
                cells = (show(channel, unit) if channel.samples else "-" for show in CHANNEL_COLUMNS.values())
                table.add_row(name.replace("_", " "), *cells)
        console.print(table)
    table = _table("side", TICK_COLUMNS, 2)
    for side, ticks in figures.ticks.items():
        if ticks.count:
            table.add_row(side, *(show(ticks) for show in TICK_COLUMNS.values()))
    console.print(table)
    for line in _lines(figures, connected=connected):
        console.print(Text(line), soft_wrap=False)
    if environment is not None:
        console.print(Text(footer(environment, figures.seed), style="dim"))


def _table(first: str, columns: Iterable[str], gap: int) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0))
    table.add_column(first, no_wrap=True)
    for name in columns:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _lines(figures: Figures, *, connected: bool) -> Iterator[str]:
    """What stands below the tables."""
    yield from _host(figures)
    yield from _connection(figures)
    link, limited = figures.link, figures.limited
    if connected:
        yield from _felt(figures)
        yield from _link(figures)
    yield (
        f"datagrams: {link.sent} sent, {link.received} received, {link.lost} lost, "
        f"{link.dropped} dropped, {link.repeats} repeats"
    )
    if dropped := _by_side(figures.drops or {}):
        yield f"dropped: {dropped}"
    if connected:
        yield from _energy(figures.energy)
        if limited.force_ticks or limited.slew_ticks or limited.motion_ticks or limited.contact_ticks:
            yield (
                f"ticks at a limit: force {limited.force_ticks}, slew {limited.slew_ticks}, "
                f"robot {limited.motion_ticks}, contact {limited.contact_ticks}"
            )
    yield f"faults: {_by_side(figures.faults) or 'none'}"
    yield from _rights(figures.realtime or {})
    if figures.recording is not None:
        yield _recording(figures.recording)
    if figures.run_time_s is not None:
        speed = figures.duration_s / figures.run_time_s
        yield f"run time {figures.run_time_s:.2f} s, {speed:.1f} x real time"


def _connection(figures: Figures) -> Iterator[str]:
    """How long each side was in session with which peer, if not all the time."""
    for side, times in figures.connection.items():
        if times is None:
            continue
        waits = [(words, getattr(times, name)) for words, name in WAITS.items()]
        parts = [f"{words} {seconds:.1f} s" for words, seconds in waits if seconds >= SHOWN_S]
        if parts:
            name = figures.known_of_peer(side, "name")
            connected = f"connected to {name}" if name else "connected"
            yield ", ".join([f"{side}: {connected} {times.connected_s:.1f} s", *parts])


def _rights(by_side: Mapping[str, Mapping[str, Any] | None]) -> Iterator[str]:
    """Rights that the kernel granted or refused."""
    for side, grants in by_side.items():
        if grants is not None:
            asked = [(name, grant) for name, grant in grants.items() if grant["detail"] != "not asked for"]
            refused = {name: "" if grant["granted"] else f"{name.replace('_', ' ')} " for name, grant in asked}
            yield f"{side}: {', '.join(refused[name] + grant['detail'] for name, grant in asked)}"


def _felt(figures: Figures) -> Iterator[str]:
    """Felt error and codec."""
    channel, unit = figures.felt, UNITS[next(iter(figures.channels))]
    errors, felt, coding = channel.errors, channel.felt, channel.coding
    if errors.error_rms is None or felt is None:
        yield "felt error: unknown; needs both sides (loopback, simulate, or record info)"
    else:
        yield (
            f"{percent(errors.violation_fraction)} of ticks outside the deadband "
            f"({percent(felt.violation_floor)} explained by network delay)"
        )
        longest_ms = 1e3 * (errors.violation_longest_s or 0.0)
        yield (
            f"outside: {errors.violation_s:.2f} s in total, longest {longest_ms:.0f} ms; "
            f"error in deadbands {_shown(errors.error_p99_deadbands)} p99, {_shown(errors.error_max_deadbands)} max"
        )
        if felt.aligned_rms is not None and felt.aligned_lag_s is not None:
            aligned = f"{unit.show(felt.aligned_rms)} with the delay removed ({felt.aligned_lag_s * 1e3:.0f} ms)"
            yield f"felt error {unit.show(errors.error_rms)} RMS; {aligned}"
    if felt is not None:
        yield from _quality(felt.quality)
    if coding is not None and coding.error_rms is not None:
        yield f"coding error {unit.show(coding.error_rms)} RMS, {unit.show(coding.error_max)} max"
    if channel.selected is not None and len(channel.selected) > 1:
        yield "sends by predictor: " + ", ".join(f"{name} {count}" for name, count in channel.selected.items())
    by_axis = [
        f"{axis} {error.error_rms * unit.factor:.{unit.digits}f}"
        for name in ("joint_torque", "gripper_torque")
        if name in figures.channels
        for axis, error in (figures.channels[name].axes or {}).items()
        if error is not None
    ]
    if by_axis:
        yield from wrap(f"error RMS by axis [{unit.name}]: {', '.join(by_axis)}", WIDTH)
    for name, of_channel in UNITS.items():  # channels whose rate of updates reached its bound
        widened = figures.channels.get(name)
        if widened is not None and widened.widened_fraction:
            most = "" if widened.widened_max is None else f", to at most {of_channel.show(widened.widened_max)}"
            words = f"deadband widened in {percent(widened.widened_fraction)} of ticks"
            yield f"{name.replace('_', ' ')}: {words}{most}"


def _quality(quality: Quality) -> Iterator[str]:
    """Measures of the displayed force in JNDs of a person."""
    parts = []
    if quality.error_rms_jnd is not None:
        parts.append(f"error {_shown(quality.error_rms_jnd)} RMS, log error {_shown(quality.log_error_rms_jnd)}")
    if quality.jump_median_jnd is not None:
        jumps = (_shown(each) for each in (quality.jump_median_jnd, quality.jump_p99_jnd, quality.jump_max_jnd))
        parts.append("jumps {} median, {} p99, {} max".format(*jumps))
    if parts:
        yield f"in JND: {'; '.join(parts)}"


def _link(figures: Figures) -> Iterator[str]:
    """Delays, losses and paths."""
    ways = figures.ways
    if figures.link.rtt_us.p50 is not None:
        jitter = "unknown" if ways.jitter_us.p50 is None else _ms(ways.jitter_us)
        yield f"round trip {_ms(figures.link.rtt_us)}, jitter {jitter}"
    for words, way in (("to the slave", ways.to_slave), ("to the master", ways.to_master)):
        parts = [] if way.one_way_us.p50 is None else [_ms(way.one_way_us)]
        if way.loss is not None:
            runs = "" if way.burst is None else f" in runs of {way.burst:.1f}"
            by = ", as that side reported" if way.is_reported else ""
            parts.append(f"{100 * way.loss:.2f} % lost{runs}{by}")
        if parts:
            yield f"{words}: {', '.join(parts)}"
    if any((late := figures.lookahead_ms or {}).values()):
        yield "look-ahead, on top of the way: " + ", ".join(f"{name} {ms:g} ms" for name, ms in late.items())
    if figures.playout_ms:
        yield f"play-out, on top of the fastest way: {figures.playout_ms:g} ms at each end"

    def words_of(path: LinkPath, side: str = "") -> str:
        return ", ".join(part for part in (path.words(side), class_words(path, figures.dscp)) if part)

    by_side = sorted((figures.paths or {}).items())
    told = [[words_of(path) for path in paths] for _, paths in by_side]
    if all(lines == told[0] for lines in told):  # once where both say the same
        yield from told[0] if told else ()
    else:
        yield from (words_of(path, side) for side, paths in by_side for path in paths)


def _host(figures: Figures) -> Iterator[str]:
    """What the host of a live session took, and which missed ticks are its."""
    host = figures.host
    if host is None:
        return
    line = f"host not watched: {host['unknown']}"
    if host["unknown"] is None:
        missed = sum(ticks.missed for ticks in figures.ticks.values())
        stalls = "1 stall" if host["stalls"] == 1 else f"{host['stalls']} stalls"
        line = f"host: {stalls}, longest {host['longest_ms']:.1f} ms"
        line += f"; {sum(host['missed'].values())} of {missed} missed ticks"
    yield f"{line}; steal {percent(host['steal'], 2) if host['steal'] is not None else 'not counted'}"


def _energy(energy: Energy) -> Iterator[str]:
    def millijoules(joules: float | None) -> str:
        return "-" if joules is None else f"{joules * 1e3:.{0 if joules >= 0.1 else 1}f} mJ"

    if energy.generated_j is not None:
        share, bound = energy.bound_share, energy.bound_j
        part = "" if share is None else f", {millijoules(bound)} allowed ({percent(share, 0)} used)"
        out, left = millijoules(energy.generated_j), millijoules(energy.dissipated_j)
        yield f"energy at the hand: {out} out{part}; {left} dissipated"


def _recording(facts: Mapping[str, Any]) -> str:
    """Path, size, completeness and cost of the recording."""
    line = f"recording: {facts['path']}, {facts['bytes'] / 1e6:.1f} MB"
    if "records" in facts:
        lost = sum(facts["lost"].values())
        line += f", {sum(facts['records'].values())} records, {lost} lost"
        if facts.get("elapsed_s"):
            line += f", {percent(facts['cpu_s'] / facts['elapsed_s'])} of a core"
    return line if facts["outcome"] == "complete" else f"{line}; {facts['outcome']}"


def status_line(records: dict[str, Any], figures: Figures) -> str:
    """One line of a running session, at most 79 characters: what is wrong, then the state, then figures. Of the newest
    record of each side, None before the first, and the figures so far.
    """
    present = {side: record for side, record in records.items() if record is not None}
    parts = [f"{figures.duration_s:6.1f} s"]
    if figures.recording is not None and not figures.recording.get("running", False):
        parts.append("NOT RECORDING")
    ages = figures.record_age_s or {}
    parts += [f"no record of the {side} for {ages[side]:.0f} s" for side in present if ages.get(side, 0.0) >= STALE_S]
    states = [_state(side, record, figures) for side, record in present.items()]
    parts.append("; ".join(dict.fromkeys(states)) or "starting")
    # The figures of a session that is over are not shown.
    if any(int(record["state"]) == State.ENGAGED.value for record in present.values()):
        name, felt = next(iter(figures.channels.items()))
        errors, rtt_us = felt.errors, figures.link.rtt_us.p50
        if felt.packets_per_s is not None and felt.reduction is not None:
            parts += [f"{name.rpartition('_')[2]} {felt.packets_per_s:.0f}/s", f"-{percent(felt.reduction)}"]
        if errors.error_rms is not None:
            parts += [f"felt {UNITS[name].show(errors.error_rms)}", f"outside {percent(errors.violation_fraction)}"]
        if rtt_us is not None:
            parts.append(f"rtt {rtt_us / 1000:.2f} ms")
    return "  ".join(parts)[: WIDTH - 1]  # a full line would wrap


def _state(side: str, record: Any, figures: Figures) -> str:
    """The state of a side in a few words, with the address or the name of its peer where that is another host."""
    state, addresses = State(int(record["state"])), figures.addresses or {}
    if state is State.ENGAGED and int(record["ramping"]) == RELEASED:
        return "button released"
    if state in (State.CONNECTING, State.LISTENING):
        if note := finding((figures.paths or {}).get(side, ())):
            return note
        if addresses:
            calls = state is State.CONNECTING
            return f"calling {addresses['slave']}" if calls else f"listening on {addresses['listen']}"
    if len(figures.peers or {}) != 1 or state not in (State.ENGAGED, State.SILENT):
        return state.name.lower()
    known = addresses.get("slave" if side == MASTER else "listen", "the peer")
    name = figures.known_of_peer(side, "name") or known
    return f"engaged with {name}" if state is State.ENGAGED else f"{name} silent"


def _by_side(counts: Mapping[str, Mapping[str, int]]) -> str:
    return ", ".join(f"{side} {name} {count}" for side, named in counts.items() for name, count in named.items())


def _shown(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _ms(us: Median) -> str:
    """Median and 99th percentile of a time [us], in milliseconds."""
    return f"{(us.p50 or 0.0) / 1e3:.2f} ms (p99 {(us.p99 or 0.0) / 1e3:.2f})"


def _pair(us: Median) -> str:
    return "-" if us.p50 is None else f"{us.p50:.0f}/{us.p99:.0f}"
