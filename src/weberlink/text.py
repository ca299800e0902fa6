"""Texts that somebody else wrote, made fit to be shown."""

from typing import Final

LONGEST_LINE: Final = 300


def one_line(text: str, limit: int = LONGEST_LINE) -> str:
    """The text in one line of printable characters, at most `limit` of them; white space becomes single spaces."""
    return " ".join("".join(letter for letter in text if letter.isprintable() or letter.isspace()).split())[:limit]
