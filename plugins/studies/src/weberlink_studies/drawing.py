"""How the figures of a study are drawn: with or without a footer, in which formats. Imports no matplotlib."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from weberlink.config import ConfigurationError

FORMATS = ("png", "pdf", "svg")


@dataclass(frozen=True)
class Drawing:
    """What whoever asks for figures has chosen."""

    # whether the environment of the measurement is printed below; it is in the file's metadata in any case
    footer: bool = True
    formats: tuple[str, ...] | None = None  # of the files, without a dot; None for the usual ones of each figure


_CURRENT: ContextVar[Drawing] = ContextVar("drawing", default=Drawing())  # noqa: B039 - it is frozen


def current() -> Drawing:
    return _CURRENT.get()


@contextmanager
def drawn_as(drawing: Drawing) -> Iterator[None]:
    """All figures within are drawn so."""
    token = _CURRENT.set(drawing)
    try:
        yield
    finally:
        _CURRENT.reset(token)


def formats_of(text: str | None) -> tuple[str, ...] | None:
    """Formats from their names with commas between them; None for None."""
    if text is None:
        return None
    names = tuple(dict.fromkeys(part.strip().lower() for part in text.split(",")))
    for name in names:
        if name not in FORMATS:
            raise ConfigurationError(f"--format: {name!r} is none of {', '.join(FORMATS)}")
    return names
