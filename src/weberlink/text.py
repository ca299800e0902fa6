"""Texts that somebody else wrote: one made fit to be shown, and what the name of a host says."""

from ipaddress import ip_address
from typing import Final

LONGEST_LINE: Final = 300


def one_line(text: str, limit: int = LONGEST_LINE) -> str:
    """The text in one line of printable characters, at most `limit` of them; white space becomes single spaces."""
    return " ".join("".join(letter for letter in text if letter.isprintable() or letter.isspace()).split())[:limit]


def is_loopback(host: str) -> bool:
    """Whether a host (an address, or `localhost`) can be reached from this one only."""
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False
