"""How many may wait at a door, and who must leave when one more comes. Pure.

A limit alone would let whoever fills it lock out all others. Here a newcomer always gets in, at the cost of those from
where most have come.
"""

from collections.abc import Hashable
from ipaddress import IPv6Address, ip_address, ip_network
from typing import Generic, TypeVar

Guest = TypeVar("Guest", bound=Hashable)


class Admission(Generic[Guest]):
    """Guests in the order in which they came.

    Args:
        most: of them.
        most_of_group: of those who come from the same place.
    """

    def __init__(self, most: int, most_of_group: int) -> None:
        self._most = most
        self._most_of_group = most_of_group
        self._groups: dict[Guest, Hashable] = {}

    def admit(self, guest: Guest, group: Hashable) -> Guest | None:
        """Let a guest in.

        Returns:
            Who must leave for it: the oldest of its group where that is full, else of the largest group where there is
            no room at all; None where there is room.
        """
        self._groups[guest] = group
        if self.count(group) > self._most_of_group:
            return self._expel(group)
        if len(self._groups) > self._most:
            return self._expel(max(self._groups.values(), key=self.count))
        return None

    def leave(self, guest: Guest) -> None:
        """Strike a guest out; one that was expelled is out already."""
        self._groups.pop(guest, None)

    def count(self, group: Hashable) -> int:
        return sum(each == group for each in self._groups.values())

    def _expel(self, group: Hashable) -> Guest:
        oldest = next(guest for guest, its_group in self._groups.items() if its_group == group)
        del self._groups[oldest]
        return oldest


def origin(address: str) -> str:
    """Where a client comes from: its IPv4 address, or the IPv6 network of 64 bits that one host may have to itself."""
    ip = ip_address(address.partition("%")[0])
    if isinstance(ip, IPv6Address):
        return str(ip.ipv4_mapped or ip_network((ip, 64), strict=False))
    return str(ip)
