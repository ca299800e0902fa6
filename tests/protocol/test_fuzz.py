import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.protocol.harness import MASTER, SLAVE, Pair, both, forms, make_endpoint, sample_update, suites
from weberlink.protocol import Endpoint, Role, State
from weberlink.protocol.security import Security
from weberlink.protocol.wire import DirectionLayout, Kind

DATAGRAMS = st.one_of(
    st.binary(max_size=100),
    st.builds(
        lambda first, rest: bytes([first]) + rest,
        st.integers(0, 255),
        st.sampled_from(
            sorted({low for low, _ in DirectionLayout([forms(3), forms(6)], acks=2).lengths(8).values()})
        ).flatmap(lambda size: st.binary(min_size=size - 1, max_size=size - 1)),
    ),
    st.builds(
        lambda kind, body: bytes([kind, 1]) + body,
        st.sampled_from([Kind.HELLO, Kind.WELCOME]),
        st.binary(max_size=200),
    ),
)


def engaged(security: Security) -> list[Endpoint]:
    """A master and a slave in a session, at 0.2 s."""
    pair = Pair(**both(security=security, outgoing=(forms(3),), incoming=(forms(3),))).engage()
    return [side.endpoint for side in pair.sides]


@pytest.mark.parametrize("security", suites())
@examples(60)
@given(st.lists(DATAGRAMS, min_size=1, max_size=20))
def test_no_bytes_raise_or_disturb_a_session(security: Security, datagrams: list[bytes]) -> None:
    master, slave = engaged(security)
    for data in datagrams:
        master.receive_datagram(data, SLAVE, 0.21)
        slave.receive_datagram(data, MASTER, 0.21)
    for sender, receiver, source in ((master, slave, MASTER), (slave, master, SLAVE)):
        assert receiver.statistics.dropped.total() == len(datagrams)
        assert sender.state is State.ENGAGED
        assert sender.send_update(0.22, sample_update(220))
        for data, _ in sender.datagrams_to_send():
            receiver.receive_datagram(data, source, 0.22)
        assert receiver.statistics.updates_received[0] == 1


@pytest.mark.parametrize("security", suites())
def test_every_truncation_and_extension_of_a_datagram_is_dropped(security: Security) -> None:
    master, slave = engaged(security)
    master.send_update(0.21, sample_update(210))
    (data, _) = master.datagrams_to_send()[0]
    for size in range(len(data)):
        slave.receive_datagram(data[:size], MASTER, 0.21)
        slave.receive_datagram(data + bytes(size + 1), MASTER, 0.21)
    assert slave.statistics.dropped.total() == 2 * len(data)
    assert slave.statistics.updates_received[0] == 0
    slave.receive_datagram(data, MASTER, 0.21)
    assert slave.statistics.updates_received[0] == 1


@pytest.mark.parametrize("role", Role)
@given(data=DATAGRAMS)
def test_no_bytes_raise_before_a_session(role: Role, data: bytes) -> None:
    for security in suites():
        endpoint = make_endpoint(role, security=security)
        endpoint.receive_datagram(data, SLAVE, 0.0)
        endpoint.connect(0.0)
        endpoint.receive_datagram(data, SLAVE, 0.0)
        endpoint.close(0.0, "")
        endpoint.receive_datagram(data, SLAVE, 0.0)
        assert endpoint.statistics.dropped.total() == 3
