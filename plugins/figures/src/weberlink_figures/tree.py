"""The figures of a session as one tree of values; `to_json` gives the document that users and other programs read.

A figure is None while it is unknown. Times end in their unit, shares are from 0 to 1, energies are in joules.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

from weberlink.protocol.paths import LinkPath
from weberlink.session.ending import Connection

GOOD, DEGRADED, FAILURE = "good", "degraded", "failed"  # the word of a verdict
FLAT = {"flat": True}  # metadata of a field whose own fields stand in its place in the document


@dataclass(frozen=True)
class Median:
    """Median and 99th percentile."""

    p50: float | None = None
    p99: float | None = None


@dataclass(frozen=True)
class Spread(Median):
    """Further percentiles, and the largest value."""

    p99_9: float | None = None
    max: float | None = None


@dataclass(frozen=True)
class Ticks:
    """Ticks of a side: done, missed, and how late and how long they were."""

    count: int
    missed: int
    missed_longest_s: float
    lateness_us: Spread
    work_us: Spread
    codec_us: Spread


@dataclass(frozen=True)
class Errors:
    """An error against its deadband: in the unit of the values, and in deadbands."""

    error_rms: float | None
    error_max: float | None
    violation_fraction: float | None
    violation_longest_s: float | None
    violation_s: float | None
    error_max_deadbands: float | None
    error_p99_deadbands: float | None


@dataclass(frozen=True)
class AxisErrors:
    """The error of one axis of an arm."""

    error_rms: float
    error_max: float


@dataclass(frozen=True)
class Quality:
    """What a person notices of a displayed force, in just noticeable differences (`weberlink_figures.felt`)."""

    error_rms_jnd: float | None = None
    error_max_jnd: float | None = None
    noticeable_fraction: float | None = None
    noticeable_longest_s: float | None = None
    log_error_rms_jnd: float | None = None
    log_error_max_jnd: float | None = None
    jump_median_jnd: float | None = None
    jump_p99_jnd: float | None = None
    jump_max_jnd: float | None = None


@dataclass(frozen=True)
class Felt:
    """Figures of the channel that the operator feels alone; of an arm, of the axis with the largest error.

    `violation_floor` is the share of its ticks that no codec can keep within the deadband, because an update is on its
    way. `aligned_rms` is the least RMS of its error against what the robot measured a lag before, and `aligned_lag_s`
    that lag: positive where the robot measured it before it was felt.
    """

    quality: Quality = field(metadata=FLAT)
    violation_floor: float | None
    aligned_rms: float | None
    aligned_lag_s: float | None


@dataclass(frozen=True)
class Channel:
    """Packets of a channel, and the error of what the receiver commanded against what the sender measured.

    `widened_fraction` is the share of the sender's ticks in which a bounded rate of updates widened the deadband, and
    `widened_max` the largest deadband then. `reduction_all` and `bytes_per_s` are of all datagrams of the direction,
    and stand with its first channel. `coding` is the error of the sender's own decoder.
    """

    samples: int
    packets: int
    packets_per_s: float | None
    reduction: float | None
    errors: Errors = field(metadata=FLAT)
    widened_fraction: float | None
    widened_max: float | None
    reduction_all: float | None = None
    bytes_per_s: float | None = None
    felt: Felt | None = field(default=None, metadata=FLAT)
    coding: Errors | None = None
    selected: Mapping[str, int] | None = None
    axes: Mapping[str, AxisErrors | None] | None = None


@dataclass(frozen=True)
class Link:
    """Delays, and datagrams of both directions together."""

    rtt_us: Median
    one_way_us: Median
    sent: int
    received: int
    lost: int
    dropped: int
    repeats: int


@dataclass(frozen=True)
class Way:
    """One direction of the link. `is_reported` says that the loss is the mean of what the receiver reported."""

    one_way_us: Median
    loss: float | None
    is_reported: bool
    burst: float | None  # mean run of lost datagrams


@dataclass(frozen=True)
class Ways:
    """Each direction apart."""

    jitter_us: Median
    to_slave: Way
    to_master: Way


@dataclass(frozen=True)
class Limited:
    """Ticks in which a limit acted."""

    force_ticks: int
    slew_ticks: int
    motion_ticks: int
    contact_ticks: int


@dataclass(frozen=True)
class Energy:
    """At the hand: taken out beyond what was put in, dissipated, and what the accounts allowed and was used of that.

    `generated_j` is the largest at any time, 0 for a passive environment; `bound_share` above 1 says that the accounts
    did not hold, and both figures of the bound are None without accounts.
    """

    generated_j: float | None
    dissipated_j: float | None
    bound_j: float | None
    bound_share: float | None


@dataclass(frozen=True)
class Cause:
    """Why a session is not good: `degraded` or `failed`; a short identifier, which no two causes of a verdict share;
    words, with the figure.
    """

    level: str
    name: str
    text: str


@dataclass(frozen=True)
class Verdict:
    """The word, and the causes, those that failed first."""

    word: str
    causes: tuple[Cause, ...]

    @property
    def line(self) -> str:
        """In one line."""
        return f"{self.word} because {'; '.join(cause.text for cause in self.causes)}" if self.causes else self.word


@dataclass(frozen=True)
class Figures:
    """All figures of a session, and the facts of its run; those from `drops` on are left out where they are None.

    `channels` are by name, that which the operator feels first; `ticks`, `connection` and what else is by side has
    master and slave. The facts of a peer, of rights, of the host and of the recording are documents of the processes
    that know them.
    """

    duration_s: float
    ticks: Mapping[str, Ticks]
    channels: Mapping[str, Channel] = field(metadata=FLAT)
    link: Link
    ways: Ways
    limited: Limited
    connection: Mapping[str, Connection | None]
    faults: Mapping[str, Mapping[str, int]]
    energy: Energy
    drops: Mapping[str, Mapping[str, int]] | None = None
    outcome: str | None = None
    addresses: Mapping[str, str] | None = None
    peers: Mapping[str, Mapping[str, str] | None] | None = None
    paths: Mapping[str, Sequence[LinkPath]] | None = None
    dscp: int | None = None
    lookahead_ms: Mapping[str, float] | None = None
    playout_ms: float | None = None
    realtime: Mapping[str, Mapping[str, Any] | None] | None = None
    host: Mapping[str, Any] | None = None
    recording: Mapping[str, Any] | None = None
    record_age_s: Mapping[str, float] | None = None
    run_time_s: float | None = None
    seed: int | None = None
    interrupted: bool | None = None
    verdict: Verdict | None = None
    status: int | None = None  # exit status of the command that ran the session

    @property
    def felt(self) -> Channel:
        """The channel that the operator feels: the force or, of an arm, the torques of its joints."""
        return next(iter(self.channels.values()))

    @property
    def is_arm(self) -> bool:
        """Whether the session is in joint space."""
        return "force" not in self.channels

    def known_of_peer(self, side: str, fact: str) -> str:
        """What a side knew of its peer (`weberlink.session.side.PeerFacts`); "" for nothing."""
        return ((self.peers or {}).get(side) or {}).get(fact, "")

    def to_json(self) -> dict[str, Any]:
        """The document, for JSON."""
        document: dict[str, Any] = to_json(self)
        return document


def to_json(value: Any) -> Any:
    """Numbers, texts, lists and dictionaries, from any part of the tree."""
    if isinstance(value, LinkPath):
        return value._asdict()
    if is_dataclass(value):
        document: dict[str, Any] = {}
        for each in fields(value):
            inner = getattr(value, each.name)
            if inner is None and each.default is None and not isinstance(value, Median | Quality):
                continue
            document |= to_json(inner) if each.metadata else {each.name: to_json(inner)}
        return document
    if isinstance(value, Mapping):
        return {name: to_json(inner) for name, inner in value.items()}
    return [to_json(inner) for inner in value] if isinstance(value, list | tuple) else value
