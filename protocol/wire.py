"""Binary layout of the datagrams of a session.

A session carries one or two streams of updates each way; each stream has its own kind of update. All fields are little
endian; n is the number of values that the two ends agreed on for the stream.

| part | field | format | bytes | meaning |
|---|---|---|---|---|
| head | kind | B | 1 | bits 0-2 kind, bit 3 mark, bits 4-6 selector, bit 7 key phase |
| head | sequence | 3s | 3 | low 24 bits of the datagram's number; every datagram of a direction has its own |
| head | ack | H | 2 | low 16 bits of the number of the newest update received of the first stream |
| head | sent | 3s | 3 | sender's clock, in 10 us, low 24 bits |
| head | tick | H | 2 | sample tick on the sender's clock, low 16 bits; a heartbeat adds the newest of all streams |
| head | echo | B | 1 | departure, on the receiver's clock, of the newest datagram heard from it (`Liveness.echo`) |
| update | newest | nh | 2n | levels of the newest sample |
| previous | gap | H | 2 | ticks between the two samples, 1..65535 |
| previous | difference | nH | 2n | newest minus previous, modulo 2^16, hence always exact |
| update_credit | count | H | 2 | low 16 bits of the sender's credit; last of an update where the session carries it |
| heartbeat | minimum | q | 8 | least raw delay of the other direction lately, in us |
| heartbeat | latest | I | 4 | raw delay of the latest datagram above the least, in us |
| heartbeat | late | I | 4 | raw delay above the least that few datagrams exceed, in us |
| heartbeat | loss | H | 2 | share of datagrams of the other direction that never came, in 1/65535 |
| heartbeat_credit | count | I | 4 | low 32 bits of the sender's credit; last of a heartbeat, likewise |
| second_ack | ack | H | 2 | as in the head, of the second stream; ends updates and heartbeats where there is one |
| bye | reason | 0-64s | 0-64 | why, UTF-8 |
| change | tick | I | 4 | sender's tick at which to make the change, low 32 bits; 0 in an answer |
| change | body | 1-200s | 1-200 | what is to change, or the answer: 1 for yes, 0 and why not |
| path | token | 8s | 8 | random bytes, which the answer returns |

The mark of an update means that a previous sample, or model parameters in its place, follow; of a heartbeat, that the
sender wants an answer at once; of a change or path, that it is an answer. The selector of an update is that of its
predictor; of a heartbeat, it is 1 if the sender's encoder runs (it runs whenever an update is sent); of a change, it is
the number of the proposal. The key phase flips with each new key of the direction.

The tag of the security suite comes last. Kind and sequence are authenticated and not encrypted; a suite with a key
encrypts what follows them. Handshake datagrams (`weberlink.protocol.handshake`) share only the first byte with this.
"""

from collections.abc import Sequence
from enum import IntEnum
from struct import Struct
from typing import NamedTuple

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

CLEAR_BYTES = 4
"""Size of kind and sequence number, which are not encrypted."""
HEAD_BYTES = 12
TICK_BITS = 16
TICK_MASK = (1 << TICK_BITS) - 1
CHANGE_TICK_BITS = 32
ACK_BYTES = 2
TOKEN_BYTES = 8
MOST_LEVELS = 256
"""Largest number of levels of a sample."""
LONGEST_REASON = 64
LONGEST_CHANGE = 200
LONGEST_DATAGRAM = 4096
"""Longest datagram that is sent or read [bytes]; only a handshake with a very long agreement comes near it."""
MARK = 0b1000
PHASE = 0b1000_0000

_KIND_MASK = 0b0111
_SELECTOR_SHIFT = 4
_SHAPE_MASK = _KIND_MASK | MARK
_U32_MAX = 0xFFFF_FFFF
_WORD = Struct("<Q")
_PREFIX = Struct("<IQ")
_HEARTBEAT = Struct("<IQqIIH")
_HEARTBEAT_BODY = Struct("<qIIH")
_CHANGE_TICK = Struct("<I")
UPDATE_CREDIT_BITS, HEARTBEAT_CREDIT_BITS = 16, 32


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
_UPDATE, _HEARTBEAT_KIND, _SECOND_UPDATE = int(Kind.UPDATE), int(Kind.HEARTBEAT), int(Kind.SECOND_UPDATE)


class Head(NamedTuple):
    """The fields that all datagrams of a session have, still truncated."""

    kind: int
    mark: bool
    selector: int
    ack: int
    sent: int
    tick: int
    echo: int

    @property
    def asks(self) -> bool:
        """Whether the sender wants an answer at once."""
        return self.mark and self.kind == _HEARTBEAT_KIND

    @property
    def is_encoding(self) -> bool:
        """Whether the sender's encoder ran when the datagram left."""
        kind = self.kind
        return kind in (_UPDATE, _SECOND_UPDATE) or (kind == _HEARTBEAT_KIND and self.selector == 1)


class Report(NamedTuple):
    """Body of a heartbeat, in the units of the wire."""

    minimum_us: int
    latest_us: int
    late_us: int
    loss_65535: int


def kind_of(data: bytes) -> int:
    """Kind of a datagram that is not empty."""
    return data[0] & _KIND_MASK


def stream_of(kind: int) -> int:
    """The stream that an update of this kind belongs to."""
    return 1 if kind == _SECOND_UPDATE else 0


def sequence_of(data: bytes) -> int:
    """Truncated sequence number of a datagram of at least `CLEAR_BYTES`."""
    return int.from_bytes(data[1:4], "little")


def pack_word(ack: int, sent: int, echo: int, tick: int = 0) -> int:
    """The encrypted part of a head as one number."""
    return ack | sent << 16 | tick << 40 | echo << 56


def read_head(first: int, body: bytes) -> Head:
    """Read the head.

    Args:
        first: first byte of the datagram.
        body: what follows `CLEAR_BYTES`, decrypted.
    """
    (word,) = _WORD.unpack_from(body)
    return Head(
        first & _KIND_MASK,
        bool(first & MARK),
        first >> _SELECTOR_SHIFT & MAX_SELECTOR,
        word & 0xFFFF,
        word >> 16 & 0xFFFFFF,
        word >> 40 & 0xFFFF,
        word >> 56,
    )


# Each `pack` makes a datagram without tag, from a truncated sequence number and a word of `pack_word`; each `unpack`
# takes a body as `read_head` does.


def pack_heartbeat(
    sequence: int,
    word: int,
    report: Report,
    credit: int | None = None,
    *,
    further_acks: tuple[int, ...] = (),
    asks: bool = False,
    is_encoding: bool = False,
) -> bytes:
    """A heartbeat, with credit and the acknowledgements of further streams where the direction carries them."""
    data = _HEARTBEAT.pack(
        Kind.HEARTBEAT | asks * MARK | is_encoding << _SELECTOR_SHIFT | sequence << 8,
        word,
        report.minimum_us,
        min(report.latest_us, _U32_MAX),
        min(report.late_us, _U32_MAX),
        report.loss_65535,
    )
    if credit is not None:
        data += (credit & _U32_MAX).to_bytes(HEARTBEAT_CREDIT_BITS // 8, "little")
    return data + b"".join(ack.to_bytes(ACK_BYTES, "little") for ack in further_acks) if further_acks else data


def unpack_report(body: bytes) -> Report:
    return Report._make(_HEARTBEAT_BODY.unpack_from(body, _WORD.size))


def pack_bye(sequence: int, word: int, reason: str) -> bytes:
    text = reason.encode(errors="replace")[:LONGEST_REASON].decode(errors="ignore").encode()
    return _PREFIX.pack(Kind.BYE | sequence << 8, word) + text


def unpack_bye(body: bytes) -> str:
    return body[_WORD.size :].decode(errors="replace")


def pack_change(sequence: int, word: int, tick: int, number: int, body: bytes, *, is_answer: bool) -> bytes:
    """A proposed change, or the answer to one."""
    first = Kind.CHANGE | is_answer * MARK | number << _SELECTOR_SHIFT | sequence << 8
    return _PREFIX.pack(first, word) + _CHANGE_TICK.pack(tick) + body[:LONGEST_CHANGE]


def unpack_change(body: bytes) -> tuple[int, bytes]:
    """Truncated tick and content."""
    return _CHANGE_TICK.unpack_from(body, _WORD.size)[0], body[_WORD.size + _CHANGE_TICK.size :]


def pack_path(sequence: int, word: int, token: bytes, *, is_answer: bool) -> bytes:
    """The question whether the peer is at an address, or the answer."""
    return _PREFIX.pack(Kind.PATH | is_answer * MARK | sequence << 8, word) + token


def unpack_path(body: bytes) -> bytes:
    return body[_WORD.size :]


class UpdateLayout:
    """Packs and unpacks the updates of one stream."""

    def __init__(
        self,
        forms: Sequence[UpdateForm],
        *,
        carries_credit: bool = False,
        further_acks: int = 0,
        kind: Kind = Kind.UPDATE,
    ) -> None:
        """Prepare for updates of these forms, by selector.

        Args:
            forms: what an update carries.
            carries_credit: whether each datagram carries the sender's credit.
            further_acks: streams of the other direction beside the first, which each datagram acknowledges too.
            kind: of the updates.

        Raises:
            ValueError: for no form or more than there are selectors, for an update without levels, or for so many that
                they do not fit a datagram.
        """
        if not 1 <= len(forms) <= MAX_SELECTOR + 1:
            raise ValueError(f"a stream has 1 to {MAX_SELECTOR + 1} forms of updates, not {len(forms)}")
        for form in forms:
            if not 1 <= sum(form.newest) <= MOST_LEVELS:
                raise ValueError(f"a sample has 1 to {MOST_LEVELS} levels, not {sum(form.newest)}")
            if form.previous is not None and form.previous != form.newest[: len(form.previous)]:
                raise ValueError(f"a previous sample has the first groups of the newest, not {form.previous}")
        self.forms = tuple(forms)
        self.carries_credit = carries_credit
        self._kind = int(kind)
        self._tail = Struct(f"<{'H' * (carries_credit + further_acks)}")

    def pack(
        self,
        sequence: int,
        word: int,
        update: Update,
        credit: int = 0,
        further_acks: tuple[int, ...] = (),
    ) -> bytes:
        """An update; acknowledgements are truncated already."""
        newest, payload = update.newest, update.payload
        first = self._kind | update.selector << _SELECTOR_SHIFT | sequence << 8
        last = (credit & 0xFFFF, *further_acks) if self.carries_credit else further_acks
        content = Struct(f"<{len(newest)}h").pack(*newest)
        if isinstance(payload, PreviousSample):
            difference = [(new - old) & 0xFFFF for new, old in zip(newest, payload.levels, strict=False)]
            content += Struct(f"<H{len(difference)}H").pack(payload.gap, *difference)
        elif payload is not None:
            content += payload.data
        return _PREFIX.pack(first | (payload is not None) * MARK, word) + content + self._tail.pack(*last)

    def check(self, update: Update) -> None:
        """Check that an update can be packed without loss.

        Raises:
            ValueError: naming the field and its range.
        """
        if not 0 <= update.selector < len(self.forms):
            raise ValueError(f"selector must be in 0..{len(self.forms) - 1}, not {update.selector}")
        form, payload = self.forms[update.selector], update.payload
        _check_levels("a sample", update.newest, sum(form.newest))
        if payload is None:
            return
        if form.previous is None:
            if not isinstance(payload, ModelParameters):
                raise ValueError(f"an update of selector {update.selector} must carry model parameters, not {payload}")
            if len(payload.data) > MOST_PARAMETER_BYTES:
                raise ValueError(
                    f"model parameters must have at most {MOST_PARAMETER_BYTES} bytes, not {len(payload.data)}"
                )
            return
        if not isinstance(payload, PreviousSample):
            raise ValueError(f"an update of selector {update.selector} must carry a previous sample, not {payload}")  # noqa: TRY004
        if not 1 <= payload.gap <= MAX_GAP:
            raise ValueError(f"gap must be in 1..{MAX_GAP}, not {payload.gap}")
        _check_levels("a previous sample", payload.levels, sum(form.previous))

    def unpack(self, body: bytes, head: Head, tick: int) -> Update | None:
        """The update, with its tick in full; None if its content does not fit its form."""
        if head.selector >= len(self.forms):
            return None
        form, at = self.forms[head.selector], _WORD.size
        levels = Struct(f"<{sum(form.newest)}h")
        end = len(body) - self._tail.size
        if end < at + levels.size:
            return None
        newest = levels.unpack_from(body, at)
        payload = self._payload(form, newest, body[at + levels.size : end]) if head.mark else None
        is_whole = payload is not None if head.mark else end == at + levels.size
        return Update(tick, head.selector, newest, payload) if is_whole else None

    @staticmethod
    def _payload(form: UpdateForm, newest: tuple[int, ...], data: bytes) -> Payload:
        """What follows the newest sample; None if it does not fit its form."""
        if form.previous is None:
            return ModelParameters(data) if len(data) <= MOST_PARAMETER_BYTES else None
        differences = Struct(f"<H{sum(form.previous)}H")
        if len(data) != differences.size:
            return None
        gap, *steps = differences.unpack(data)
        levels = [((new - step + 0x8000) & 0xFFFF) - 0x8000 for new, step in zip(newest, steps, strict=False)]
        return PreviousSample(gap, tuple(levels)) if gap else None

    def length(self, update: Update) -> int:
        """Bytes of an update, without tag."""
        return len(self.pack(0, 0, update, 0, (0,) * (self._tail.size // 2 - self.carries_credit)))

    @property
    def lengths(self) -> tuple[int, int]:
        """Bytes of the shortest and of the longest update, without tag."""
        fixed = HEAD_BYTES + self._tail.size
        levels = [2 * sum(form.newest) for form in self.forms]
        payloads = [
            MOST_PARAMETER_BYTES if form.previous is None else 2 + 2 * sum(form.previous) for form in self.forms
        ]
        longest = max(level + payload for level, payload in zip(levels, payloads, strict=True))
        return fixed + min(levels), fixed + longest


def _check_levels(what: str, levels: Sequence[int], count: int) -> None:
    if len(levels) != count or not all(-0x8000 <= level <= 0x7FFF for level in levels):
        raise ValueError(f"{what} must be {count} levels of int16, not {levels!r}")


class DirectionLayout:
    """The layouts of all datagrams of one direction.

    Attributes:
        updates: by stream.
        carries_credit: whether each update and heartbeat carries the sender's credit.
        further_acks: how many streams of the other direction each of them acknowledges beside the first.
    """

    def __init__(
        self,
        streams: Sequence[Sequence[UpdateForm]],
        *,
        carries_credit: bool = False,
        further_acks: int = 0,
    ) -> None:
        """Prepare for streams whose updates have these forms, by selector.

        Raises:
            ValueError: for no stream or more than there are kinds of updates, or as `UpdateLayout`.
        """
        if not 1 <= len(streams) <= len(UPDATE_KINDS):
            raise ValueError(f"a direction has 1 to {len(UPDATE_KINDS)} streams of updates, not {len(streams)}")
        self.carries_credit = carries_credit
        self.further_acks = further_acks
        self.updates = tuple(
            UpdateLayout(forms, carries_credit=carries_credit, further_acks=further_acks, kind=kind)
            for forms, kind in zip(streams, UPDATE_KINDS, strict=False)
        )

    def read_acks(self, body: bytes) -> tuple[int, ...]:
        """Acknowledgements of further streams at the end of an update or heartbeat."""
        return tuple(
            int.from_bytes(body[at : at + ACK_BYTES], "little")
            for at in range(len(body) - ACK_BYTES * self.further_acks, len(body), ACK_BYTES)
        )

    def read_credit(self, kind: int, body: bytes) -> tuple[int, int]:
        """Truncated credit of an update or heartbeat that carries it, and its number of bits."""
        end = len(body) - ACK_BYTES * self.further_acks
        bits = HEARTBEAT_CREDIT_BITS if kind == _HEARTBEAT_KIND else UPDATE_CREDIT_BITS
        return int.from_bytes(body[end - bits // 8 : end], "little"), bits

    def lengths(self, tag_size: int) -> dict[int, tuple[int, int]]:
        """Shortest and longest datagram of each shape (kind and mark) that a peer of these layouts sends."""
        bye = HEAD_BYTES + tag_size
        credit = HEARTBEAT_CREDIT_BITS // 8 if self.carries_credit else 0
        heartbeat = _HEARTBEAT.size + credit + ACK_BYTES * self.further_acks + tag_size
        change = bye + _CHANGE_TICK.size
        path = bye + TOKEN_BYTES
        updates = {
            kind | mark: (layout.lengths[0] + tag_size, layout.lengths[1] + tag_size)
            for layout, kind in zip(self.updates, UPDATE_KINDS, strict=False)
            for mark in (0, MARK)
        }
        return updates | {
            Kind.HEARTBEAT: (heartbeat, heartbeat),
            Kind.HEARTBEAT | MARK: (heartbeat, heartbeat),
            Kind.BYE: (bye, bye + LONGEST_REASON),
            Kind.CHANGE: (change + 1, change + LONGEST_CHANGE),
            Kind.CHANGE | MARK: (change + 1, change + LONGEST_CHANGE),
            Kind.PATH: (path, path),
            Kind.PATH | MARK: (path, path),
        }


def length_fault(data: bytes, lengths: dict[int, tuple[int, int]]) -> DropReason | None:
    """Why the length of a datagram, not empty, does not fit its shape; None if it does."""
    limits = lengths.get(data[0] & _SHAPE_MASK)
    if limits is None:
        return DropReason.UNKNOWN_KIND
    if len(data) < limits[0]:
        return DropReason.TRUNCATED
    return DropReason.WRONG_LENGTH if len(data) > limits[1] else None
