"""The relay's books: every datagram is somewhere, whatever is done to it."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.soak.books import Book, Books
from tests.soak.direction import Direction
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.wire import Kind

UPDATE, HELLO = bytes((Kind.UPDATE,)), bytes((Kind.HELLO,))
ROUGH = Emulation(delay_s=0.01, jitter_s=0.02, loss=0.3, reorder=0.2, duplicate=0.3, corrupt=0.3)


class Receiver:
    """Takes what is passed on; refuses, or is not there, when told so."""

    def __init__(self) -> None:
        self.took: list[bytes] = []
        self.answer: bool | None = True

    def __call__(self, data: bytes) -> bool | None:
        if self.answer:
            self.took.append(data)
        return self.answer


@pytest.fixture
def receiver() -> Receiver:
    return Receiver()


@pytest.fixture
def way(receiver: Receiver) -> Direction:
    return Direction(receiver, Random(1).random)


def test_a_perfect_link_passes_everything_on(way: Direction, receiver: Receiver) -> None:
    for number in range(5):
        way.take(UPDATE + bytes((number,)), 1.0)
    way.deliver(1.0)
    assert receiver.took == [UPDATE + bytes((number,)) for number in range(5)]
    book = way.reading()
    assert (book.arrived, book.passed, book.passed_bytes, book.under_way, book.balance) == (5, 5, 10, 0, 0)


@given(
    seed=st.integers(0, 10_000),
    steps=st.lists(
        st.sampled_from(["take", "take", "take", "emulate", "mend", "hold", "old", "drop", "give", "replay", "refuse"]),
        max_size=60,
    ),
)
def test_every_datagram_is_accounted_for(seed: int, steps: list[str]) -> None:
    receiver, random = Receiver(), Random(seed)
    way = Direction(receiver, random.random)
    now = 0.0
    for step in steps:
        now += 0.004
        match step:
            case "take":
                way.take(UPDATE + random.randbytes(8), now)
            case "emulate":
                way.emulate(ROUGH)
            case "mend":
                way.emulate(Emulation())
            case "hold":
                way.hold()
            case "old":
                way.release_old(now - 0.02)
            case "drop" | "give":
                way.release(deliver=step == "give")
            case "replay":
                way.replay(3, 0.0, now)
            case "refuse":
                receiver.answer = random.choice([True, False, None])
        way.deliver(now)
        assert way.reading().balance == 0, step
    assert way.book.passed == len(receiver.took)


def test_a_lost_datagram_would_show(way: Direction) -> None:
    way.take(UPDATE, 0.0)
    way.book.arrived += 1
    assert way.reading().balance == 1


def test_harm_is_counted_as_what_it_is(way: Direction, receiver: Receiver) -> None:
    way.emulate(Emulation(corrupt=1.0, duplicate=1.0))
    way.take(UPDATE + bytes(20), 0.0)
    way.deliver(0.0)
    assert receiver.took[0] == receiver.took[1] != UPDATE + bytes(20)
    assert (way.book.corrupted, way.book.duplicated, way.book.passed) == (2, 1, 2)
    way.emulate(Emulation(loss=1.0))
    way.take(UPDATE, 0.1)
    way.deliver(0.1)
    assert (way.book.lost, way.reading().balance) == (1, 0)


def test_what_is_under_way_when_the_link_changes_still_arrives(way: Direction, receiver: Receiver) -> None:
    way.emulate(Emulation(delay_s=0.5))
    way.take(UPDATE, 0.0)
    way.emulate(Emulation())
    way.take(HELLO, 0.1)
    way.deliver(0.1)
    assert receiver.took == [HELLO]
    assert way.reading().under_way == 1
    assert way.next_due == 0.5
    way.deliver(0.5)
    assert receiver.took == [HELLO, UPDATE]
    assert way.book.handshakes == 1


def test_old_ones_are_delivered_and_the_rest_is_held_on(way: Direction, receiver: Receiver) -> None:
    way.hold()
    for number in range(6):
        way.take(UPDATE + bytes((number,)), float(number))
    way.deliver(9.0)
    assert receiver.took == []
    assert way.release_old(2.0) == 3
    assert [data[1] for data in receiver.took] == [0, 1, 2]
    way.take(UPDATE, 7.0)
    assert len(receiver.took) == 3
    assert way.release(deliver=False) == 4
    assert (way.book.released, way.book.discarded, way.reading().balance) == (3, 4, 0)
    way.take(UPDATE, 8.0)
    way.deliver(8.0)
    assert len(receiver.took) == 4


def test_only_what_was_passed_on_whole_is_sent_again(way: Direction, receiver: Receiver) -> None:
    way.take(HELLO, 0.0)
    way.take(UPDATE + b"1", 0.0)
    way.deliver(0.0)
    way.emulate(Emulation(corrupt=1.0))
    way.take(UPDATE + b"2", 1.0)
    way.deliver(1.0)
    way.emulate(Emulation(loss=1.0))
    way.take(UPDATE + b"3", 2.0)
    way.deliver(2.0)
    receiver.took.clear()
    assert way.replay(10, 0.0, 3.0) == 1
    assert receiver.took == [UPDATE + b"1"]
    assert way.replay(10, 0.5, 3.0) == 0
    assert way.reading().balance == 0


def test_nobody_there_and_no_room_are_told_apart(way: Direction, receiver: Receiver) -> None:
    for answer in (None, False):
        receiver.answer = answer
        way.take(UPDATE, 0.0)
        way.deliver(0.0)
    assert (way.book.orphaned, way.book.refused, way.reading().balance) == (1, 1, 0)


def test_books_survive_the_way_to_another_process() -> None:
    books = Books(1.5, Book(arrived=3), Book(passed=2), 1, 2, ("127.0.0.1", 5), ("127.0.0.2", 6))
    assert Books.from_dict(books.to_dict()) == books
    assert (books.forward - Book(arrived=1)).arrived == 2
