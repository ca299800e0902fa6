"""What this host is connected to, in a namespace of its own."""

import asyncio
from collections.abc import Iterator
from contextlib import suppress

import pytest

from plugins.anywhere.tests.namespaces import Namespace, needs_testbed
from tests.wait import PATIENCE, until
from weberlink_anywhere.networks import Networks, Watch, look

pytestmark = needs_testbed
QUIET_S = 0.8
BOTH = Networks({"192.168.1.2": "wifi", "192.168.2.2": "phone"}, ("phone", "wifi"))


def shows(expected: Networks) -> None:
    """The kernel says so, as soon as it has dealt with a link that came up or went down."""
    until(lambda: look() == expected, f"the kernel to say {expected}")


@pytest.fixture
def host() -> Iterator[Namespace]:
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
        with space.entered():
            shows(BOTH)
        yield space
    finally:
        space.delete()


def test_addresses_and_ways_outside_by_metric(host: Namespace) -> None:
    assert BOTH.of(("wifi",)) == {"192.168.1.2": "wifi"}
    assert BOTH.of(()) == BOTH.addresses
    host.ip("link set phone-end down")
    with host.entered():
        shows(Networks({"192.168.1.2": "wifi"}, ("wifi",)))


def test_watch_tells_of_changed_address_of_its_interfaces(host: Namespace) -> None:
    async def watch() -> list[bool]:
        changed, told = asyncio.Event(), []
        watching = Watch(changed.set, ("wifi",))
        for number, name, longest in ((1, "wifi", PATIENCE), (2, "phone", QUIET_S)):
            changed.clear()
            host.ip(f"addr add 192.168.{number}.3/24 dev {name}")
            with suppress(TimeoutError):
                await asyncio.wait_for(changed.wait(), longest)
            told.append(changed.is_set())
        watching.close()
        return told

    with host.entered():
        assert asyncio.run(watch()) == [True, False]
