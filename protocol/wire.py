"""Layout of the datagrams of a session: `TABLE`, by which they are packed, read and measured.

A session carries one or two streams of updates each way; each stream has its own kind of update. A datagram is a string
of bits, of which each field takes the next ones, highest bit first. Zeros fill the last byte. A field of whole
bytes begins at a whole byte, and its length follows from that of the datagram. The tag of the security suite comes
last. The clear part is authenticated. A suite with a key encrypts what follows it, and hides selector, mark and kind
among the values of the first byte that are no handshake.

The mark of an update means that a previous sample, or model parameters in its place, follow; of a heartbeat, that the
sender wants an answer at once; of a change or path, that it is an answer. The selector of an update is that of its
predictor; of a heartbeat, 1 is added if the sender's encoder runs (it runs whenever an update is sent), 2 if a report
follows, and 4 if an opening follows; of a change, it is the number of the proposal (4 to 7: of the round trip).

An acknowledgement is sent until the peer is known to have heard a datagram with it. Where there is none, the newest one
that was received still holds. Handshake datagrams (`weberlink.protocol.handshake`) share only the first byte with this.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import Final, NamedTuple

from weberlink.update import (
    MAX_GAP,
    MAX_SELECTOR,
    MOST_PARAMETER_BYTES,
    ModelParameters,
    Payload,
    PreviousSample,
    Update,
    UpdateForm,
)

TOKEN_BYTES: Final = 8
LONGEST_REASON: Final = 64
LONGEST_CHANGE: Final = 200
ACKNOWLEDGEMENT_BITS: Final = 16
_WIDTH_BITS: Final = 4  # how wide the numbers of a group are: 1 to 16
_LEVEL_BITS: Final = 16
_GROUP: Final = _WIDTH_BITS + _LEVEL_BITS


class Field(NamedTuple):
    """A field of a part of a datagram: its least and most bits (0 where they are those of groups), and its meaning."""

    part: str
    name: str
    least: int
    most: int
    meaning: str


TABLE: Final = (
    Field("clear", "phase", 1, 1, "key phase: it flips with each new key of the direction"),
    Field("clear", "selector", 3, 3, "of the predictor, or as the kind says"),
    Field("clear", "mark", 1, 1, "as the kind says"),
    Field("clear", "kind", 3, 3, "`Kind`"),
    Field("clear", "sequence", 16, 16, "low bits of the datagram's number, low byte first; each direction has its own"),
    Field("head", "generation", 1, 1, "parity of the agreed round trip, in whose units the echo is (`Liveness`)"),
    Field("head", "sent", 23, 23, "sender's clock, in 10 us, low bits"),
    Field("head", "echo", 8, 8, "departure, on the receiver's clock, of the newest datagram heard (`Liveness.echo`)"),
    Field("ack", "tells", 1, 1, "whether an acknowledgement follows; for each stream of the other direction"),
    Field("ack", "number", 0, ACKNOWLEDGEMENT_BITS, "low bits of the number of the newest update, if it tells"),
    Field("update", "lags", 1, 1, "whether the tick of the sample is another one than that of `sent`"),
    Field("update", "lag", 0, _GROUP, "a group of one: tick of `sent` minus tick of the sample, if it lags"),
    Field("update", "newest", 0, 0, "levels of the newest sample, in groups"),
    Field("previous", "gap", 4, 19, "ticks between the samples: bits after the highest one (4), then those bits"),
    Field("previous", "difference", 0, 0, "newest minus previous, modulo 2^16, in groups"),
    Field("update_ticks", "ticks", 16, 16, "as of a heartbeat; where the direction has two streams"),
    Field("update_credit", "count", 16, 16, "low bits of the sender's credit; where the session carries it"),
    Field("parameters", "data", 0, 8 * MOST_PARAMETER_BYTES, "of the model; the predictor knows their length"),
    Field("heartbeat", "ticks", 16, 16, "sum of the ticks of the sender's newest updates of all streams, low bits"),
    Field("heartbeat_credit", "count", 32, 32, "low bits of the sender's credit; where the session carries it"),
    Field("report", "minimum_us", 48, 48, "least raw delay of the other direction lately, two's complement"),
    Field("report", "latest_us", 24, 24, "raw delay of the latest datagram above the least"),
    Field("report", "late_us", 24, 24, "raw delay above the least that few datagrams exceed"),
    Field("report", "loss_65535", 16, 16, "share of datagrams of the other direction that never came, in 1/65535"),
    Field("report", "burst_256", 16, 16, "mean run of datagrams that never came, in 1/256; 0 for unknown"),
    Field("report", "lost", 16, 16, "number of the datagrams of the other direction that never came, low bits"),
    Field("opening", "round_trip_ms", 16, 16, "round trip with which the session begins"),
    Field("bye", "reason", 0, 8 * LONGEST_REASON, "why, UTF-8"),
    Field("change", "tick", 32, 32, "sender's tick at which to make the change, low bits; 0 in an answer"),
    Field("change", "body", 8, 8 * LONGEST_CHANGE, "what is to change, or the answer: 1 for yes, 0 and why not"),
    Field("path", "token", 8 * TOKEN_BYTES, 8 * TOKEN_BYTES, "random bytes, which the answer returns"),
)
"""Every field, in the order on the wire. A group of numbers is the width of the widest of them less 1 (4 bits), then
each number in so many bits, two's complement. Levels are grouped as `UpdateForm` says: values of a similar size."""


def _widths(part: str) -> tuple[int, ...]:
    return tuple(field.most for field in TABLE if field.part == part)


CLEAR_BYTES: Final = sum(_widths("clear")) // 8  # size of kind and sequence number, which are not encrypted
SEQUENCE_BITS: Final = _widths("clear")[-1]
"""A number is expanded from what came last, so an outage may take up to 2^15 of them. In the longest that a session
outlives, an end sends far fewer: a silent one sends heartbeats only."""
SEQUENCE_MASK: Final = (1 << SEQUENCE_BITS) - 1
HALF_SEQUENCE: Final = 1 << SEQUENCE_BITS - 1
ACKNOWLEDGEMENT_MASK: Final = (1 << ACKNOWLEDGEMENT_BITS) - 1
GENERATION_BITS, SENT_BITS, ECHO_BITS = _widths("head")
(TICK_BITS,) = _widths("heartbeat")
CHANGE_TICK_BITS = _widths("change")[0]
HALF_CHANGE_TICK = 1 << CHANGE_TICK_BITS - 1
(UPDATE_CREDIT_BITS,), (HEARTBEAT_CREDIT_BITS,) = _widths("update_credit"), _widths("heartbeat_credit")
MOST_LEVELS: Final = 256  # largest number of levels of a sample
LONGEST_DATAGRAM: Final = 4096
"""Longest datagram that is sent or read [bytes]; only a handshake with a very long agreement comes near it."""
MARK: Final = 0b1000
PHASE: Final = 0b1000_0000
ENCODES: Final = 1
REPORTS: Final = 2
OPENS: Final = 4
"""Parts of the selector of a heartbeat."""
LOSS_UNITS: Final = 65_535
BURST_UNITS: Final = 256
"""A loss of 1, and a burst of one datagram, in the units of the wire."""
LOST_MASK: Final = 0xFFFF

_KIND_MASK: Final = 0b0111
_SELECTOR_SHIFT: Final = 4
_TIMES_BITS: Final = GENERATION_BITS + SENT_BITS + ECHO_BITS
_SENT_MASK: Final = (1 << SENT_BITS) - 1
_ECHO_MASK: Final = (1 << ECHO_BITS) - 1
_REPORT: Final = _widths("report")
(_OPENING_BITS,) = _widths("opening")
_MINIMUM_SIGN: Final = 1 << _REPORT[0] - 1
_LARGEST: Final = (1 << _LEVEL_BITS - 1) - 1


class Kind(IntEnum):
    """The low three bits of every datagram that is packed; the whole first byte of a handshake."""

    PATH = 0  # asks whether the peer is at an address, or answers that
    HELLO = 1
    WELCOME = 2
    UPDATE = 3
    HEARTBEAT = 4
    BYE = 5
    CHANGE = 6
    SECOND_UPDATE = 7
    """An update of the second stream."""


UPDATE_KINDS = (Kind.UPDATE, Kind.SECOND_UPDATE)  # by stream
# A comparison with an int is faster than one with a member of an enumeration.
UPDATE, HEARTBEAT, SECOND_UPDATE = int(Kind.UPDATE), int(Kind.HEARTBEAT), int(Kind.SECOND_UPDATE)
BYE, CHANGE, PATH = int(Kind.BYE), int(Kind.CHANGE), int(Kind.PATH)
_DATA_BYTES: Final = {BYE: (0, LONGEST_REASON), CHANGE: (1, LONGEST_CHANGE), PATH: (TOKEN_BYTES, TOKEN_BYTES)}

Envelope = tuple[int, int, int, int, tuple[int | None, ...]]
"""What every datagram says beside its content, already truncated: its number; generation and echo of `Liveness`, and
between them when it leaves, on the sender's clock; by stream of the other direction, the acknowledgement, or None if it
carries none."""


class Report(NamedTuple):
    """Measurements of a heartbeat, in the units of the wire."""

    minimum_us: int
    latest_us: int
    late_us: int
    loss_65535: int
    burst_256: int
    lost: int


class Content(NamedTuple):
    """What a datagram says. What the wire truncates is truncated here.

    Args:
        kind, mark, selector, generation, sent, echo: as in `TABLE`.
        acks: by stream of the other direction; None where it carries none.
        update: of an update; in the place of its tick, the tick of `sent` minus that of its sample.
        tick: of a heartbeat, and of an update where there are two streams, the sum of ticks; of a change, its tick.
        credit: None where the session carries none.
        report: of a heartbeat that has one.
        round_trip_ms: of a heartbeat that opens a session.
        data: reason, body or token.
    """

    kind: int
    mark: bool
    selector: int
    generation: int
    sent: int
    echo: int
    acks: tuple[int | None, ...]
    update: Update | None = None
    tick: int = 0
    credit: int | None = None
    report: Report | None = None
    round_trip_ms: int | None = None
    data: bytes = b""


def sequence_of(data: bytes) -> int:
    """Truncated sequence number of a datagram of at least `CLEAR_BYTES`."""
    return data[1] | data[2] << 8


# A string that is being made is one integer: a 1, then its bits, so that its length need not be counted beside it.


def pack_groups(string: int, groups: Sequence[int], numbers: Sequence[int]) -> int:
    """A string with groups of so many int16 numbers appended, each group as wide as its largest number needs."""
    start = 0
    for count in groups:
        group = numbers[start : start + count]
        start += count
        magnitudes = 0
        for number in group:
            magnitudes |= ~number if number < 0 else number
        width = magnitudes.bit_length() + 1
        mask = (1 << width) - 1
        string = string << _WIDTH_BITS | width - 1
        for number in group:
            string = string << width | number & mask
    return string


def to_bytes(string: int) -> bytes:
    """A string, with zeros up to a whole byte."""
    size = string.bit_length() - 1
    unused = -size % 8
    return (string << unused).to_bytes((size + unused) // 8 + 1, "big")[1:]


def _pack_head(first: int, envelope: Envelope) -> int:
    """The clear part and the head, as a string of bits."""
    sequence, generation, sent, echo, acks = envelope
    # Low byte first: otherwise the sequence number in the start value of `Checksum` would cancel this one.
    string = 1 << 24 | first << 16 | (sequence & 0xFF) << 8 | sequence >> 8
    string = ((string << GENERATION_BITS | generation) << SENT_BITS | sent) << ECHO_BITS | echo
    for ack in acks:
        string = string << 1 if ack is None else (string << 1 | 1) << ACKNOWLEDGEMENT_BITS | ack
    return string


# The following make datagrams without tag.


def pack_heartbeat(
    envelope: Envelope,
    ticks: int,
    report: Report | None = None,
    credit: int | None = None,
    *,
    round_trip_ms: int | None = None,
    asks: bool = False,
    is_encoding: bool = False,
) -> bytes:
    """A heartbeat; `ticks` is truncated already, `credit` is None where the session carries none."""
    selector = is_encoding * ENCODES | (report is not None) * REPORTS | (round_trip_ms is not None) * OPENS
    string = _pack_head(HEARTBEAT | asks * MARK | selector << _SELECTOR_SHIFT, envelope) << TICK_BITS | ticks
    if credit is not None:
        string = string << HEARTBEAT_CREDIT_BITS | credit & (1 << HEARTBEAT_CREDIT_BITS) - 1
    if report is not None:
        for index, width in enumerate(_REPORT):
            number, mask = report[index], (1 << width) - 1
            # The least delay may be negative; what is longer than its field saturates.
            string = string << width | (number & mask if index == 0 else min(number, mask))
    if round_trip_ms is not None:
        string = string << _OPENING_BITS | round_trip_ms
    return to_bytes(string)


def pack(
    envelope: Envelope, kind: int, data: bytes, *, mark: bool = False, selector: int = 0, tick: int | None = None
) -> bytes:
    """A farewell, a path, or a change with its tick."""
    head = _pack_head(kind | mark * MARK | selector << _SELECTOR_SHIFT, envelope)
    return to_bytes(head if tick is None else head << CHANGE_TICK_BITS | tick & (1 << CHANGE_TICK_BITS) - 1) + data


def cut(reason: str) -> bytes:
    """The reason of a farewell, in at most `LONGEST_REASON` bytes."""
    return reason.encode(errors="replace")[:LONGEST_REASON].decode(errors="ignore").encode()


# Of a received string, `bits`, the lowest `left` bits are still to be read. One that ends too early makes `left`
# negative, and a shift by a negative number is a ValueError: so each reader checks the end for all of its fields.


def read_groups(bits: int, left: int, groups: Sequence[int]) -> tuple[tuple[int, ...], int]:
    """The numbers of `pack_groups`, and how many bits are left."""
    numbers: list[int] = []
    for count in groups:
        left -= _WIDTH_BITS
        width = (bits >> left & (1 << _WIDTH_BITS) - 1) + 1
        end = left - width * count
        half, mask = 1 << width - 1, (1 << width) - 1
        while left > end:
            left -= width
            numbers.append(((bits >> left & mask) ^ half) - half)
    return tuple(numbers), left


def read_rest(bits: int, left: int) -> bytes:
    """The whole bytes that are left; bits before them must be 0."""
    size = left // 8
    if bits >> 8 * size & (1 << left % 8) - 1:
        raise ValueError("bits after the end")
    return (bits & (1 << 8 * size) - 1).to_bytes(size, "big")


class UpdateLayout:
    """Packs and unpacks the updates of one stream."""

    def __init__(
        self,
        forms: Sequence[UpdateForm],
        *,
        carries_credit: bool = False,
        carries_ticks: bool = False,
        acks: int = 1,
        kind: Kind = Kind.UPDATE,
    ) -> None:
        """Prepare for updates of these forms, by selector; `acks` is the number of streams of the other direction.

        Where its own direction has two streams, an update carries the ticks of both.

        Raises:
            ValueError: for no form or more than there are selectors, for an update without levels, or for so many that
                they do not fit a datagram.
        """
        if not 1 <= len(forms) <= MAX_SELECTOR + 1:
            raise ValueError(f"a stream has 1 to {MAX_SELECTOR + 1} forms of updates, not {len(forms)}")
        for form in forms:
            if not (form.newest and min(form.newest) >= 1 and sum(form.newest) <= MOST_LEVELS):
                raise ValueError(f"a sample has 1 to {MOST_LEVELS} levels in groups of 1 or more, not {form.newest}")
            if form.previous is not None and form.previous != form.newest[: len(form.previous)]:
                raise ValueError(f"a previous sample has the first groups of the newest, not {form.previous}")
        self.forms = tuple(forms)
        self._sizes = tuple((sum(form.newest), sum(form.previous or ())) for form in forms)
        self._carries_credit, self._carries_ticks = carries_credit, carries_ticks
        self._acks = acks
        self._kind = int(kind)

    def check(self, update: Update) -> None:
        """Raise ValueError, naming the field and its range, for an update that cannot be packed without loss."""
        _, selector, newest, payload = update
        if not 0 <= selector < len(self.forms):
            raise ValueError(f"selector must be in 0..{len(self.forms) - 1}, not {selector}")
        size, previous_size = self._sizes[selector]
        if len(newest) != size or min(newest) < -_LARGEST - 1 or max(newest) > _LARGEST:
            raise ValueError(f"a sample must be {size} levels of int16, not {newest!r}")
        if payload is None:
            return
        if isinstance(payload, PreviousSample) is (self.forms[selector].previous is None):
            expected = "model parameters" if self.forms[selector].previous is None else "a previous sample"
            raise ValueError(f"an update of selector {selector} must carry {expected}, not {payload}")
        if isinstance(payload, ModelParameters):
            if len(payload.data) > (most := self.forms[selector].most_bytes):
                raise ValueError(f"model parameters must have at most {most} bytes, not {len(payload.data)}")
            return
        gap, levels = payload
        if not 1 <= gap <= MAX_GAP:
            raise ValueError(f"gap must be in 1..{MAX_GAP}, not {gap}")
        if len(levels) != previous_size or (previous_size and (min(levels) < -_LARGEST - 1 or max(levels) > _LARGEST)):
            raise ValueError(f"a previous sample must be {previous_size} levels of int16, not {levels!r}")

    def pack(self, envelope: Envelope, lag: int, update: Update, credit: int = 0, ticks: int = 0) -> bytes:
        """An update that `check` accepts, with the tick of `sent` minus that of its sample, modulo 2^16; `ticks` is
        truncated already."""
        _, selector, newest, payload = update
        form = self.forms[selector]
        first = self._kind | selector << _SELECTOR_SHIFT
        string = _pack_head(first if payload is None else first | MARK, envelope) << 1
        if lag:
            string = pack_groups(string | 1, (1,), ((lag + 0x8000 & 0xFFFF) - 0x8000,))
        string = pack_groups(string, form.newest, newest)
        if isinstance(payload, PreviousSample):
            gap, levels = payload
            width = gap.bit_length() - 1
            string = (string << _WIDTH_BITS | width) << width | gap - (1 << width)
            differences = [(new - old + 0x8000 & 0xFFFF) - 0x8000 for new, old in zip(newest, levels, strict=False)]
            string = pack_groups(string, form.previous or (), differences)
        if self._carries_ticks:
            string = string << TICK_BITS | ticks
        if self._carries_credit:
            string = string << UPDATE_CREDIT_BITS | credit & (1 << UPDATE_CREDIT_BITS) - 1
        packed = to_bytes(string)
        return packed + payload.data if isinstance(payload, ModelParameters) else packed

    def read(self, bits: int, left: int, selector: int, *, mark: bool) -> tuple[Update, int, int | None]:
        """The update in the lowest `left` bits, after the head, with its lag as its tick; the sum of ticks, 0 where it
        has none; and the truncated credit."""
        if selector >= len(self.forms):
            raise ValueError(f"selector {selector} of {len(self.forms)}")
        form = self.forms[selector]
        left -= 1
        lag = bits >> left & 1
        if lag:
            (lag,), left = read_groups(bits, left, (1,))
        newest, left = read_groups(bits, left, form.newest)
        payload: Payload = None
        if mark and form.previous is not None:
            left -= _WIDTH_BITS
            width = bits >> left & (1 << _WIDTH_BITS) - 1
            left -= width
            gap = 1 << width | bits >> left & (1 << width) - 1
            steps, left = read_groups(bits, left, form.previous)
            levels = [(new - step + 0x8000 & 0xFFFF) - 0x8000 for new, step in zip(newest, steps, strict=False)]
            payload = PreviousSample(gap, tuple(levels))
        ticks = 0
        if self._carries_ticks:
            left -= TICK_BITS
            ticks = bits >> left & (1 << TICK_BITS) - 1
        credit: int | None = None
        if self._carries_credit:
            left -= UPDATE_CREDIT_BITS
            credit = bits >> left & (1 << UPDATE_CREDIT_BITS) - 1
        data = read_rest(bits, left)
        if mark and form.previous is None:
            payload = ModelParameters(data)
        if len(data) > (form.most_bytes if isinstance(payload, ModelParameters) else 0):
            raise ValueError(f"{len(data)} bytes after the levels")
        return Update(lag, selector, newest, payload), ticks, credit

    def length(self, update: Update) -> int:
        """Bytes of an update whose sample is of its tick, with acknowledgements, without tag."""
        return len(self.pack((0, 0, 0, 0, (0,) * self._acks), 0, update))

    @property
    def lengths(self) -> tuple[int, int]:
        """Bytes of the shortest and of the longest update, without tag."""
        short: Envelope = (0, 0, 0, 0, (None,) * self._acks)
        long: Envelope = (0, 0, 0, 0, (0,) * self._acks)
        least, most = LONGEST_DATAGRAM, 0
        for selector, form in enumerate(self.forms):
            zeros, widest = (0,) * sum(form.newest), (-_LARGEST - 1,) * sum(form.newest)
            payload: Payload = ModelParameters(bytes(form.most_bytes))
            if form.previous is not None:
                payload = PreviousSample(MAX_GAP, (0,) * sum(form.previous))
            least = min(least, len(self.pack(short, 0, Update(0, selector, zeros))))
            most = max(most, len(self.pack(long, -_LARGEST - 1, Update(0, selector, widest, payload))))
        return least, most


class DirectionLayout:
    """The layouts of all datagrams of one direction; `updates` by stream."""

    def __init__(self, streams: Sequence[Sequence[UpdateForm]], *, carries_credit: bool = False, acks: int = 1) -> None:
        """Prepare for streams whose updates have these forms, by selector; `acks` streams of the other direction.

        Raises ValueError for no stream or more than there are kinds of updates, or as `UpdateLayout`."""
        if not 1 <= len(streams) <= len(UPDATE_KINDS):
            raise ValueError(f"a direction has 1 to {len(UPDATE_KINDS)} streams of updates, not {len(streams)}")
        self.carries_credit = carries_credit
        self._acks = acks
        self.updates = tuple(
            UpdateLayout(forms, carries_credit=carries_credit, carries_ticks=len(streams) > 1, acks=acks, kind=kind)
            for forms, kind in zip(streams, UPDATE_KINDS, strict=False)
        )

    def read(self, content: bytes) -> Content:
        """What a datagram says: its first byte as it was packed, and what follows `CLEAR_BYTES`, decrypted.

        Raises ValueError if it is none that a peer of these layouts sends."""
        first, bits = content[0], int.from_bytes(content, "big")
        left = 8 * (len(content) - 1) - _TIMES_BITS
        word = bits >> left & (1 << _TIMES_BITS) - 1
        generation, sent, echo = word >> SENT_BITS + ECHO_BITS, word >> ECHO_BITS & _SENT_MASK, word & _ECHO_MASK
        acks: list[int | None] = []
        for _ in range(self._acks):
            ack: int | None = None
            left -= 1
            if bits >> left & 1:
                left -= ACKNOWLEDGEMENT_BITS
                ack = bits >> left & ACKNOWLEDGEMENT_MASK
            acks.append(ack)
        kind, mark, selector = first & _KIND_MASK, first & MARK != 0, first >> _SELECTOR_SHIFT & MAX_SELECTOR
        head = kind, mark, selector, generation, sent, echo, tuple(acks)
        if kind in (UPDATE, SECOND_UPDATE):
            stream = int(kind == SECOND_UPDATE)
            if stream >= len(self.updates):
                raise ValueError(f"stream {stream} of {len(self.updates)}")
            return Content(*head, *self.updates[stream].read(bits, left, selector, mark=mark))
        if kind == HEARTBEAT:
            return Content(*head, None, *self._read_heartbeat(bits, left, selector))
        if kind not in _DATA_BYTES:
            raise ValueError(f"kind {kind}")
        tick = 0
        if kind == CHANGE:
            left -= CHANGE_TICK_BITS
            tick = bits >> left & (1 << CHANGE_TICK_BITS) - 1
        data = read_rest(bits, left)
        least, most = _DATA_BYTES[kind]
        if not least <= len(data) <= most:
            raise ValueError(f"{len(data)} bytes in a datagram of kind {kind}")
        return Content(*head, tick=tick, data=data)

    def _read_heartbeat(self, bits: int, left: int, selector: int) -> tuple[int, int | None, Report | None, int | None]:
        credit: int | None = None
        report: Report | None = None
        round_trip_ms: int | None = None
        left -= TICK_BITS
        tick = bits >> left & (1 << TICK_BITS) - 1
        if self.carries_credit:
            left -= HEARTBEAT_CREDIT_BITS
            credit = bits >> left & (1 << HEARTBEAT_CREDIT_BITS) - 1
        if selector & REPORTS:
            numbers = []
            for width in _REPORT:
                left -= width
                numbers.append(bits >> left & (1 << width) - 1)
            numbers[0] = (numbers[0] ^ _MINIMUM_SIGN) - _MINIMUM_SIGN
            report = Report(*numbers)
        if selector & OPENS:
            left -= _OPENING_BITS
            round_trip_ms = bits >> left & (1 << _OPENING_BITS) - 1
        if read_rest(bits, left):
            raise ValueError("bytes after the heartbeat")
        return tick, credit, report, round_trip_ms

    @property
    def lengths(self) -> tuple[int, int]:
        """Bytes of the shortest and of the longest datagram that a peer of these layouts sends, as packed."""
        shortest = len(pack((0, 0, 0, 0, (None,) * self._acks), BYE, b""))
        change = len(pack((0, 0, 0, 0, (0,) * self._acks), CHANGE, bytes(LONGEST_CHANGE), tick=0))
        return shortest, max(change, *(layout.lengths[1] for layout in self.updates))
