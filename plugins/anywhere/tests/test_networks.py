"""What this host is connected to, in a namespace of its own."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

from plugins.anywhere.tests.namespaces import Namespace, needs_testbed
from weberlink_anywhere.networks import Networks, Watch, look

pytestmark = needs_testbed
QUIET_S, HANG_S = 0.8, 10.0


@pytest.fixture
def host() -> Iterator[Namespace]:
    """Two interfaces with a default route each; `phone` has the lower metric."""
    space = Namespace("n")
    try:
        for name, number, metric in (("wifi", 1, 200), ("phone", 2, 100)):
            space.ip(
                f"link add {name} type veth peer name {name}-end",
                f"addr add 192.168.{number}.2/24 dev {name}",
                f"link set {name}-end up",
                f"link set {name} up",
                f"route add default via 192.168.{number}.1 dev {name} metric {metric}",
            )
        yield space
    finally:
        space.delete()


def test_addresses_and_ways_outside_by_metric(host: Namespace) -> None:
    with host.entered():
        now = look()
    assert now == Networks({"192.168.1.2": "wifi", "192.168.2.2": "phone"}, ("phone", "wifi"))
    assert now.of(("wifi",)) == {"192.168.1.2": "wifi"}
    assert now.of(()) == now.addresses
    host.ip("link set phone-end down")
    with host.entered():
        assert look() == Networks({"192.168.1.2": "wifi"}, ("wifi",))


def changes(host: Namespace, actions: list[Callable[[], None]], interfaces: tuple[str, ...] = ()) -> list[bool]:
    """Whether the watch calls back after each action."""

    async def watch() -> list[bool]:
        changed = asyncio.Event()
        with host.entered():
            watching = Watch(changed.set, interfaces)
            try:
                told = []
                for action in actions:
                    changed.clear()
                    action()
                    with suppress(TimeoutError):
                        await asyncio.wait_for(changed.wait(), QUIET_S)
                    told.append(changed.is_set())
                return told
            finally:
                watching.close()

    return asyncio.run(asyncio.wait_for(watch(), HANG_S))


def test_watch_tells_of_changed_address_of_its_interfaces(host: Namespace) -> None:
    actions = [
        lambda: host.ip("addr add 192.168.1.3/24 dev wifi"),
        lambda: host.ip("addr add 192.168.2.3/24 dev phone"),
    ]
    assert changes(host, actions, ("wifi",)) == [True, False]
