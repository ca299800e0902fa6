"""Who gets in where there is not room for all."""

from hypothesis import given
from hypothesis import strategies as st

from weberlink.apps.monitor.admission import Admission, origin


def test_the_oldest_of_a_full_group_leaves() -> None:
    admission: Admission[int] = Admission(10, 2)
    assert [admission.admit(guest, "a") for guest in range(4)] == [None, None, 0, 1]
    assert admission.admit(4, "b") is None


def test_without_room_the_largest_group_gives_way() -> None:
    admission: Admission[int] = Admission(4, 3)
    assert [admission.admit(guest, "many") for guest in range(3)] == [None] * 3
    assert [admission.admit(guest, f"one {guest}") for guest in range(3, 5)] == [None, 0]
    admission.leave(4)
    admission.leave(0)
    assert admission.admit(5, "one 5") is None


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 5)), max_size=60))
def test_a_newcomer_always_gets_in_and_no_limit_is_passed(steps: list[tuple[bool, int]]) -> None:
    admission: Admission[int] = Admission(6, 3)
    inside: dict[int, int] = {}
    for guest, (leaves, group) in enumerate(steps):
        if leaves and inside:
            gone = next(iter(inside))
            admission.leave(gone)
            del inside[gone]
        expelled = admission.admit(guest, group)
        inside[guest] = group
        if expelled is not None:
            assert expelled != guest
            del inside[expelled]
        assert len(inside) <= 6
        counts = [list(inside.values()).count(each) for each in range(6)]
        assert max(counts) <= 3
        assert [admission.count(each) for each in range(6)] == counts


def test_a_host_is_known_by_its_network() -> None:
    assert origin("192.0.2.1") == origin("::ffff:192.0.2.1") != origin("192.0.2.2")
    assert origin("2001:db8::1") == origin("2001:db8::2") != origin("2001:db8:0:1::1")
    assert origin("fe80::1%eth0") == origin("fe80::2")
