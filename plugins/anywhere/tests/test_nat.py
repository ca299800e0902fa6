"""Kinds of NAT: told exactly by a server with two addresses, and never wrongly by others."""

from collections.abc import Sequence
from itertools import product

import pytest
from hypothesis import given, strategies as st

from weberlink.protocol.events import Address
from weberlink_anywhere.nat import ANY, Behaviour, Nat, Question, Reply, examine

LOCAL = ("192.168.1.2", 50_000)
FIRST, OTHER = ("203.0.113.1", 3478), ("203.0.113.2", 3479)
KINDS = list(product(Behaviour, Behaviour))


class EmulatedNat:
    """Behind it, servers that answer as RFC 5780 says, at the `alive` addresses; one at `FIRST` has `OTHER` too."""

    def __init__(self, mapping: Behaviour, filtering: Behaviour, alive: Sequence[Address]) -> None:
        self._mapping, self._filtering, self._alive = mapping, filtering, alive
        self._ports: dict[object, int] = {}
        self._sent_to: set[Address] = set()

    def reply(self, question: Question) -> Reply | None:
        server = question.server
        self._sent_to.add(server)
        if server not in self._alive:
            return None
        source, other = server, None
        if server[0] in (FIRST[0], OTHER[0]):
            other = (OTHER[0] if server[0] == FIRST[0] else FIRST[0], 6957 - server[1])
            source = (
                other[0] if question.from_other_address else server[0],
                other[1] if question.from_other_port else server[1],
            )
        if not any(self._seen(self._filtering, source) == self._seen(self._filtering, to) for to in self._sent_to):
            return None
        port = self._ports.setdefault(self._seen(self._mapping, server), 20_000 + len(self._ports))
        return Reply(("198.51.100.7", port), source, other)

    @staticmethod
    def _seen(behaviour: Behaviour, address: Address) -> object:
        """What a behaviour tells addresses apart by."""
        whole, host = behaviour is Behaviour.ADDRESS_AND_PORT, behaviour is Behaviour.ADDRESS
        return address if whole else address[0] if host else None


def talk(nat: EmulatedNat, servers: Sequence[Address], local: Address = LOCAL) -> Nat | None:
    talking = examine(local, servers)
    question = next(talking)
    while True:
        try:
            question = talking.send(nat.reply(question))
        except StopIteration as end:
            return end.value


ENDS = (FIRST, OTHER, (FIRST[0], OTHER[1]), (OTHER[0], FIRST[1]))


@pytest.mark.parametrize(("mapping", "filtering"), KINDS)
def test_server_with_two_ends_tells_the_kind(mapping: Behaviour, filtering: Behaviour) -> None:
    found = talk(EmulatedNat(mapping, filtering, ENDS), [FIRST])
    assert found == Nat(FIRST, ("198.51.100.7", 20_000), True, frozenset({mapping}), frozenset({filtering}))
    assert found.needs_relay is (mapping is not Behaviour.INDEPENDENT)


ADDRESSES = [(f"203.0.113.{host}", port) for host in (5, 6, 7) for port in (3478, 3479)]


@given(
    kind=st.sampled_from(KINDS),
    servers=st.lists(st.sampled_from(ADDRESSES), min_size=1, max_size=4, unique=True),
    data=st.data(),
)
def test_other_servers_never_tell_a_wrong_kind(
    kind: tuple[Behaviour, Behaviour], servers: list[Address], data: st.DataObject
) -> None:
    alive = data.draw(st.lists(st.sampled_from(servers), unique=True))
    found = talk(EmulatedNat(*kind, alive), servers)
    if not alive:
        assert found is None
        return
    assert found is not None
    assert kind[0] in found.mapping
    assert kind[1] in found.filtering


@pytest.mark.parametrize("mapping", Behaviour)
def test_two_servers_tell_whether_the_mapping_is_one(mapping: Behaviour) -> None:
    servers = [ADDRESSES[0], ADDRESSES[2]]
    found = talk(EmulatedNat(mapping, Behaviour.ADDRESS_AND_PORT, servers), servers)
    assert found is not None
    assert found.needs_relay is (mapping is not Behaviour.INDEPENDENT)
    assert found.filtering == ANY
