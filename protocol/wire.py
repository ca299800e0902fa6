"""Binary layout of the datagrams of a session.

A session carries one or two streams of updates each way; each stream has its own kind of update. A datagram is a string
of bits (`weberlink.protocol.bits`), of which each field takes the next ones, the highest first. Zeros fill the last
byte. What a table gives in bytes begins at a whole byte, and its length follows from that of the datagram.

| part | field | size | meaning |
|---|---|---|---|
| clear | phase | 1 bit | key phase: it flips with each new key of the direction |
| clear | selector | 3 bits | see below |
| clear | mark | 1 bit | see below |
| clear | kind | 3 bits | `Kind` |
| clear | sequence | 16 bits | low bits of the datagram's number, low byte first; each of a direction has its own |
| head | generation | 1 bit | parity of the round trip that the sender uses, in whose units the echo is (`Liveness`) |
| head | sent | 23 bits | sender's clock, in 10 us, low bits |
| head | echo | 8 bits | departure, on the receiver's clock, of the newest datagram heard from it (`Liveness.echo`) |
| head | tells | 1 bit | whether an acknowledgement follows; for each stream of the other direction |
| ack | number | 16 bits | low bits of the number of the newest update received of that stream; follows its `tells` |
| update | lags | 1 bit | whether the tick of the sample is another one than that of `sent` |
| lag | ticks | 5-20 bits | a group of one: tick of `sent` minus tick of the sample; only if it lags |
| update | newest | groups | levels of the newest sample |
| previous | gap | 4-19 bits | ticks between the two samples: bits after the highest one (4), then those bits |
| previous | difference | groups | newest minus previous, modulo 2^16, hence always exact |
| update_credit | count | 16 bits | low bits of the sender's credit; where the session carries it |
| parameters | data | 0-48 bytes | parameters of the model; the predictor knows their length |
| heartbeat | ticks | 16 bits | sum of the ticks of the sender's newest updates of all streams, low bits |
| heartbeat_credit | count | 32 bits | low bits of the sender's credit; where the session carries it |
| report | minimum | 48 bits | least raw delay of the other direction lately, in us, two's complement |
| report | latest | 24 bits | raw delay of the latest datagram above the least, in us |
| report | late | 24 bits | raw delay above the least that few datagrams exceed, in us |
| report | loss | 16 bits | share of datagrams of the other direction that never came, in 1/65535 |
| report | burst | 16 bits | mean length of the runs of datagrams that never came, in 1/256; 0 for unknown |
| report | lost | 16 bits | number of the datagrams of the other direction that never came, low bits |
| opening | round_trip | 16 bits | round trip with which the session begins, in ms |
| bye | reason | 0-64 bytes | why, UTF-8 |
| change | tick | 32 bits | sender's tick at which to make the change, low bits; 0 in an answer |
| change | body | 1-200 bytes | what is to change, or the answer: 1 for yes, 0 and why not |
| path | token | 8 bytes | random bytes, which the answer returns |

A group of numbers is the width of the widest of them less 1 (4 bits), then each number in so many bits, two's
complement. Levels are grouped as `UpdateForm` says: values of a similar size.

The mark of an update means that a previous sample, or model parameters in its place, follow; of a heartbeat, that the
sender wants an answer at once; of a change or path, that it is an answer. The selector of an update is that of its
predictor; of a heartbeat, 1 is added if the sender's encoder runs (it runs whenever an update is sent), 2 if a report
follows, and 4 if an opening follows; of a change, it is the number of the proposal (4 to 7: of the round trip).

An acknowledgement is sent until the peer is known to have heard a datagram with it. Where there is none, the newest one
that was received still holds.

The tag of the security suite comes last. The clear part is authenticated and not encrypted; a suite with a key encrypts
what follows it. Handshake datagrams (`weberlink.protocol.handshake`) share only the first byte with this.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import Final, NamedTuple

from weberlink.protocol.bits import (
    WIDTH_BITS,
    MalformedError,
    end,
    put_count,
    put_group,
    take,
    take_count,
    take_group,
    take_rest,
    to_bytes,
)
from weberlink.protocol.counters import ACKNOWLEDGEMENT_BITS, int16
from weberlink.protocol.events import DropReason
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

CLEAR_BYTES: Final = 3
"""Size of kind and sequence number, which are not encrypted."""
SENT_BITS: Final = 23
GENERATION_BITS: Final = 1
ECHO_BITS: Final = 8
TICK_BITS: Final = 16
CHANGE_TICK_BITS: Final = 32
UPDATE_CREDIT_BITS: Final = 16
HEARTBEAT_CREDIT_BITS: Final = 32
TOKEN_BYTES: Final = 8
MOST_LEVELS: Final = 256
"""Largest number of levels of a sample."""
LONGEST_REASON: Final = 64
LONGEST_CHANGE: Final = 200
LONGEST_DATAGRAM: Final = 4096
"""Longest datagram that is sent or read [bytes]; only a handshake with a very long agreement comes near it."""
MARK: Final = 0b1000
PHASE: Final = 0b1000_0000
ENCODES: Final = 1
REPORTS: Final = 2
OPENS: Final = 4
"""Parts of the selector of a heartbeat."""

_KIND_MASK: Final = 0b0111
_SELECTOR_SHIFT: Final = 4
_SHAPE_MASK: Final = _KIND_MASK | MARK
_U32_MAX: Final = 0xFFFF_FFFF
_LEVEL_BITS: Final = 16
_ACK: Final = 1 << ACKNOWLEDGEMENT_BITS
_ACK_BITS: Final = 1 + ACKNOWLEDGEMENT_BITS
_ECHO_MASK: Final = (1 << ECHO_BITS) - 1
_SENT_MASK: Final = (1 << SENT_BITS) - 1
_TIMES_BITS: Final = GENERATION_BITS + SENT_BITS + ECHO_BITS
_OPENING_BITS: Final = 16
_LARGEST: Final = (1 << _LEVEL_BITS - 1) - 1
_REPORT_WIDTHS = (48, 24, 24, 16, 16, 16)
_LONGEST_EXCESS: Final = (1 << _REPORT_WIDTHS[1]) - 1
_MINIMUM_SIGN = 1 << _REPORT_WIDTHS[0] - 1
_MINIMUM_MASK = (1 << _REPORT_WIDTHS[0]) - 1
LOSS_UNITS: Final = 65_535
BURST_UNITS: Final = 256
"""A loss of 1, and a burst of one datagram, in the units of the wire."""
_LONGEST_BURST: Final = 0xFFFF
LOST_MASK: Final = 0xFFFF


class Kind(IntEnum):
    """The low three bits of every datagram."""

    PATH = 0
    """Asks whether the peer is at an address, or answers that."""
    HELLO = 1
    WELCOME = 2
    UPDATE = 3
    HEARTBEAT = 4
    BYE = 5
    CHANGE = 6
    SECOND_UPDATE = 7
    """An update of the second stream."""


UPDATE_KINDS = (Kind.UPDATE, Kind.SECOND_UPDATE)
"""By stream."""
# A comparison with an int is faster than one with a member of an enumeration.
_UPDATE, _HEARTBEAT, _SECOND_UPDATE = int(Kind.UPDATE), int(Kind.HEARTBEAT), int(Kind.SECOND_UPDATE)
_BYE, _CHANGE, _PATH = int(Kind.BYE), int(Kind.CHANGE), int(Kind.PATH)


Envelope = tuple[int, int, int, int, tuple[int | None, ...]]
"""What every datagram says beside its content, already truncated: its number; generation and echo of `Liveness`, and
between them when it leaves, on the sender's clock; by stream of the other direction, the acknowledgement, or None if it
carries none."""


class Head(NamedTuple):
    """The fields that all datagrams of a session have, still truncated."""

    kind: int
    mark: bool
    selector: int
    generation: int
    sent: int
    echo: int
    acks: tuple[int | None, ...]

    @property
    def asks(self) -> bool:
        """Whether the sender wants an answer at once."""
        return self.mark and self.kind == _HEARTBEAT

    @property
    def is_encoding(self) -> bool:
        """Whether the sender's encoder ran when the datagram left."""
        kind = self.kind
        return kind in (_UPDATE, _SECOND_UPDATE) or (kind == _HEARTBEAT and self.selector & ENCODES == ENCODES)


class Report(NamedTuple):
    """Measurements of a heartbeat, in the units of the wire."""

    minimum_us: int
    latest_us: int
    late_us: int
    loss_65535: int
    burst_256: int
    lost: int


class UpdateContent(NamedTuple):
    """Of an update: the tick of `sent` minus that of its sample, its sample and payload, and the truncated credit."""

    lag: int
    newest: tuple[int, ...]
    payload: Payload
    credit: int | None


class HeartbeatContent(NamedTuple):
    """Of a heartbeat: the truncated sum of ticks, the truncated credit, and if it has them the report and the round
    trip with which the session begins [ms]."""

    ticks: int
    credit: int | None
    report: Report | None
    round_trip_ms: int | None = None


class ByeContent(NamedTuple):
    reason: str


class ChangeContent(NamedTuple):
    """Of a change: its truncated tick and what is to change, or the answer."""

    tick: int
    body: bytes


class PathContent(NamedTuple):
    token: bytes


Content = UpdateContent | HeartbeatContent | ByeContent | ChangeContent | PathContent


def kind_of(data: bytes) -> int:
    """Kind of a datagram that is not empty."""
    return data[0] & _KIND_MASK


def stream_of(kind: int) -> int:
    """The stream that an update of this kind belongs to."""
    return 1 if kind == _SECOND_UPDATE else 0


def sequence_of(data: bytes) -> int:
    """Truncated sequence number of a datagram of at least `CLEAR_BYTES`."""
    return int.from_bytes(data[1:CLEAR_BYTES], "little")


def _begun(first: int, envelope: Envelope) -> int:
    """The clear part and the head, as a string of bits (`weberlink.protocol.bits`)."""
    sequence, generation, sent, echo, acks = envelope
    # Low byte first: otherwise the sequence number in the start value of `Checksum` would cancel this one.
    string = 1 << 24 | first << 16 | (sequence & 0xFF) << 8 | sequence >> 8
    string = string << _TIMES_BITS | generation << SENT_BITS + ECHO_BITS | sent << ECHO_BITS | echo
    for ack in acks:
        string = string << 1 if ack is None else string << _ACK_BITS | _ACK | ack
    return string


# Each `pack` makes a datagram without tag.


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
    string = _begun(_HEARTBEAT | asks * MARK | selector << _SELECTOR_SHIFT, envelope) << TICK_BITS | ticks
    if credit is not None:
        string = string << HEARTBEAT_CREDIT_BITS | credit & _U32_MAX
    if report is not None:
        delays = (
            report.minimum_us & _MINIMUM_MASK,
            min(report.latest_us, _LONGEST_EXCESS),
            min(report.late_us, _LONGEST_EXCESS),
        )
        losses = report.loss_65535, min(report.burst_256, _LONGEST_BURST), report.lost
        for number, width in zip((*delays, *losses), _REPORT_WIDTHS, strict=True):
            string = string << width | number
    if round_trip_ms is not None:
        string = string << _OPENING_BITS | round_trip_ms
    return to_bytes(string)


def pack_bye(envelope: Envelope, reason: str) -> bytes:
    text = reason.encode(errors="replace")[:LONGEST_REASON].decode(errors="ignore").encode()
    return to_bytes(_begun(_BYE, envelope)) + text


def pack_change(envelope: Envelope, tick: int, number: int, body: bytes, *, is_answer: bool) -> bytes:
    """A proposed change, or the answer to one; the tick is truncated already."""
    begun = _begun(_CHANGE | is_answer * MARK | number << _SELECTOR_SHIFT, envelope)
    return to_bytes(begun << CHANGE_TICK_BITS | tick) + body[:LONGEST_CHANGE]


def pack_path(envelope: Envelope, token: bytes, *, is_answer: bool) -> bytes:
    """The question whether the peer is at an address, or the answer."""
    return to_bytes(_begun(_PATH | is_answer * MARK, envelope)) + token


class UpdateLayout:
    """Packs and unpacks the updates of one stream."""

    def __init__(
        self,
        forms: Sequence[UpdateForm],
        *,
        carries_credit: bool = False,
        acks: int = 1,
        kind: Kind = Kind.UPDATE,
    ) -> None:
        """Prepare for updates of these forms, by selector.

        Args:
            forms: what an update carries.
            carries_credit: whether each datagram carries the sender's credit.
            acks: number of streams of the other direction.
            kind: of the updates.

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
        self._sizes = tuple(sum(form.newest) for form in forms)
        self._carries_credit = carries_credit
        self._acks = acks
        self._kind = int(kind)

    def pack(self, envelope: Envelope, lag: int, update: Update, credit: int = 0) -> bytes:
        """An update that `check` accepts, with the tick of `sent` minus that of its sample, -2^15 to 2^15 - 1."""
        _, selector, newest, payload = update
        form = self.forms[selector]
        first = self._kind | selector << _SELECTOR_SHIFT
        string = _begun(first if payload is None else first | MARK, envelope)
        string = put_group(string << 1 | 1, (lag,)) if lag else string << 1
        string = _put_groups(string, form.newest, newest)
        if isinstance(payload, PreviousSample):
            differences = [int16(new - old) for new, old in zip(newest, payload.levels, strict=False)]
            string = _put_groups(put_count(string, payload.gap), form.previous or (), differences)
        if self._carries_credit:
            string = string << UPDATE_CREDIT_BITS | credit & 0xFFFF
        packed = to_bytes(string)
        return packed + payload.data if isinstance(payload, ModelParameters) else packed

    def check(self, update: Update) -> None:
        """Check that an update can be packed without loss.

        Raises:
            ValueError: naming the field and its range.
        """
        if not 0 <= update.selector < len(self.forms):
            raise ValueError(f"selector must be in 0..{len(self.forms) - 1}, not {update.selector}")
        form, payload = self.forms[update.selector], update.payload
        _check_levels("a sample", update.newest, self._sizes[update.selector])
        if payload is None:
            return
        if isinstance(payload, PreviousSample) is (form.previous is None):
            expected = "model parameters" if form.previous is None else "a previous sample"
            raise ValueError(f"an update of selector {update.selector} must carry {expected}, not {payload}")
        if isinstance(payload, ModelParameters):
            if len(payload.data) > MOST_PARAMETER_BYTES:
                raise ValueError(
                    f"model parameters must have at most {MOST_PARAMETER_BYTES} bytes, not {len(payload.data)}"
                )
            return
        if not 1 <= payload.gap <= MAX_GAP:
            raise ValueError(f"gap must be in 1..{MAX_GAP}, not {payload.gap}")
        _check_levels("a previous sample", payload.levels, sum(form.previous or ()))

    def read(self, bits: int, left: int, head: Head) -> UpdateContent:
        """The content in the lowest `left` bits, after the head.

        Raises:
            MalformedError: if it does not fit its form.
        """
        if head.selector >= len(self.forms):
            raise MalformedError(f"selector {head.selector} of {len(self.forms)}")
        form = self.forms[head.selector]
        lag = 0
        left -= 1
        if left >= 0 and bits >> left & 1:
            (lag,), left = take_group(bits, left, 1)
        newest, left = _take_groups(bits, left, form.newest)
        payload: Payload = None
        if head.mark and form.previous is not None:
            gap, left = take_count(bits, left)
            steps, left = _take_groups(bits, left, form.previous)
            payload = PreviousSample(gap, tuple([int16(new - step) for new, step in zip(newest, steps, strict=False)]))
        credit: int | None = None
        if self._carries_credit:
            credit, left = take(bits, left, UPDATE_CREDIT_BITS)
        if head.mark and form.previous is None:
            payload = ModelParameters(take_rest(bits, left))
            if len(payload.data) > MOST_PARAMETER_BYTES:
                raise MalformedError(f"{len(payload.data)} bytes of parameters")
        else:
            end(bits, left)
        return UpdateContent(lag, newest, payload, credit)

    def length(self, update: Update, *, acknowledges: bool = True) -> int:
        """Bytes of an update whose sample is of its tick, without tag.

        Args:
            update: one that `check` accepts.
            acknowledges: whether it carries the acknowledgements.
        """
        return len(self.pack((0, 0, 0, 0, (0 if acknowledges else None,) * self._acks), 0, update))

    @property
    def lengths(self) -> tuple[int, int]:
        """Bytes of the shortest and of the longest update, without tag."""
        head = _TIMES_BITS + self._acks + 1 + self._carries_credit * UPDATE_CREDIT_BITS
        most_head = head + self._acks * ACKNOWLEDGEMENT_BITS + WIDTH_BITS + _LEVEL_BITS
        shortest, longest = [], []
        for form in self.forms:
            shortest.append(_bytes(head + _bits(form.newest, 1)))
            most = most_head + _bits(form.newest, _LEVEL_BITS)
            if form.previous is None:
                longest.append(_bytes(most) + MOST_PARAMETER_BYTES)
            else:
                longest.append(_bytes(most + WIDTH_BITS + _LEVEL_BITS - 1 + _bits(form.previous, _LEVEL_BITS)))
        return CLEAR_BYTES + min(shortest), CLEAR_BYTES + max(longest)


def _bytes(bits: int) -> int:
    return -(-bits // 8)


def _bits(groups: Sequence[int], width: int) -> int:
    """Bits of groups of numbers of this width."""
    return sum(WIDTH_BITS + width * count for count in groups)


def _put_groups(string: int, groups: Sequence[int], numbers: Sequence[int]) -> int:
    start = 0
    for count in groups:
        string = put_group(string, numbers[start : start + count])
        start += count
    return string


def _take_groups(bits: int, left: int, groups: Sequence[int]) -> tuple[tuple[int, ...], int]:
    numbers: tuple[int, ...] = ()
    for count in groups:
        group, left = take_group(bits, left, count)
        numbers += group
    return numbers, left


def _check_levels(what: str, levels: Sequence[int], size: int) -> None:
    if len(levels) != size or (size and (min(levels) < -_LARGEST - 1 or max(levels) > _LARGEST)):
        raise ValueError(f"{what} must be {size} levels of int16, not {levels!r}")


class DirectionLayout:
    """The layouts of all datagrams of one direction.

    Attributes:
        updates: by stream.
        carries_credit: whether each update and heartbeat carries the sender's credit.
        acks: number of streams of the other direction, which each datagram may acknowledge.
    """

    def __init__(self, streams: Sequence[Sequence[UpdateForm]], *, carries_credit: bool = False, acks: int = 1) -> None:
        """Prepare for streams whose updates have these forms, by selector.

        Raises:
            ValueError: for no stream or more than there are kinds of updates, or as `UpdateLayout`.
        """
        if not 1 <= len(streams) <= len(UPDATE_KINDS):
            raise ValueError(f"a direction has 1 to {len(UPDATE_KINDS)} streams of updates, not {len(streams)}")
        self.carries_credit = carries_credit
        self.acks = acks
        self.updates = tuple(
            UpdateLayout(forms, carries_credit=carries_credit, acks=acks, kind=kind)
            for forms, kind in zip(streams, UPDATE_KINDS, strict=False)
        )

    def read(self, first: int, body: bytes) -> tuple[Head, Content]:
        """Head and content of a datagram.

        Args:
            first: first byte of the datagram.
            body: what follows `CLEAR_BYTES`, decrypted.

        Raises:
            MalformedError: if it is none that a peer of these layouts sends.
        """
        bits = int.from_bytes(body, "big")
        word, left = take(bits, 8 * len(body), _TIMES_BITS)
        acks: list[int | None] = []
        for _ in range(self.acks):
            ack: int | None = None
            tells, left = take(bits, left, 1)
            if tells:
                ack, left = take(bits, left, ACKNOWLEDGEMENT_BITS)
            acks.append(ack)
        kind = first & _KIND_MASK
        selector = first >> _SELECTOR_SHIFT & MAX_SELECTOR
        generation, sent = word >> SENT_BITS + ECHO_BITS, word >> ECHO_BITS & _SENT_MASK
        head = Head(kind, first & MARK != 0, selector, generation, sent, word & _ECHO_MASK, tuple(acks))
        if kind in (_UPDATE, _SECOND_UPDATE):
            stream = stream_of(kind)
            if stream >= len(self.updates):
                raise MalformedError(f"stream {stream} of {len(self.updates)}")
            return head, self.updates[stream].read(bits, left, head)
        return head, self._other(bits, left, head)

    def _other(self, bits: int, left: int, head: Head) -> Content:
        """The content of a datagram that is no update."""
        match head.kind:
            case Kind.HEARTBEAT:
                return self._heartbeat(bits, left, head)
            case Kind.BYE:
                return ByeContent(take_rest(bits, left).decode(errors="replace"))
            case Kind.CHANGE:
                tick, left = take(bits, left, CHANGE_TICK_BITS)
                return ChangeContent(tick, take_rest(bits, left))
            case Kind.PATH:
                return PathContent(take_rest(bits, left))
        raise MalformedError(f"kind {head.kind}")

    def _heartbeat(self, bits: int, left: int, head: Head) -> HeartbeatContent:
        ticks, left = take(bits, left, TICK_BITS)
        credit: int | None = None
        if self.carries_credit:
            credit, left = take(bits, left, HEARTBEAT_CREDIT_BITS)
        report = None
        if head.selector & REPORTS:
            numbers = []
            for width in _REPORT_WIDTHS:
                number, left = take(bits, left, width)
                numbers.append(number)
            minimum, latest, late, loss, burst, lost = numbers
            report = Report((minimum ^ _MINIMUM_SIGN) - _MINIMUM_SIGN, latest, late, loss, burst, lost)
        round_trip_ms: int | None = None
        if head.selector & OPENS:
            round_trip_ms, left = take(bits, left, _OPENING_BITS)
        end(bits, left)
        return HeartbeatContent(ticks, credit, report, round_trip_ms)

    def lengths(self, tag_size: int) -> dict[int, tuple[int, int]]:
        """Shortest and longest datagram of each shape (kind and mark) that a peer of these layouts sends."""
        least = _TIMES_BITS + self.acks
        most = least + self.acks * ACKNOWLEDGEMENT_BITS
        pulse = TICK_BITS + self.carries_credit * HEARTBEAT_CREDIT_BITS
        changes = CHANGE_TICK_BITS, CHANGE_TICK_BITS + 8 * LONGEST_CHANGE
        sizes = {
            Kind.HEARTBEAT: (pulse, pulse + sum(_REPORT_WIDTHS) + _OPENING_BITS),
            Kind.CHANGE: (changes[0] + 8, changes[1]),
            Kind.PATH: (8 * TOKEN_BYTES, 8 * TOKEN_BYTES),
        }
        clear = CLEAR_BYTES + tag_size
        shapes = {
            kind: (clear + _bytes(least + low), clear + _bytes(most + high)) for kind, (low, high) in sizes.items()
        }
        shapes |= {
            kind: (layout.lengths[0] + tag_size, layout.lengths[1] + tag_size)
            for layout, kind in zip(self.updates, UPDATE_KINDS, strict=False)
        }
        both = {kind | mark: limits for kind, limits in shapes.items() for mark in (0, MARK)}
        return both | {int(Kind.BYE): (clear + _bytes(least), clear + _bytes(most) + LONGEST_REASON)}


def length_fault(data: bytes, lengths: dict[int, tuple[int, int]]) -> DropReason | None:
    """Why the length of a datagram, not empty, does not fit its shape; None if it does."""
    limits = lengths.get(data[0] & _SHAPE_MASK)
    if limits is None:
        return DropReason.UNKNOWN_KIND
    if len(data) < limits[0]:
        return DropReason.TRUNCATED
    return DropReason.WRONG_LENGTH if len(data) > limits[1] else None
