"""How figures are drawn: with or without a footer, in which formats, and the options for it. Imports no matplotlib."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Annotated

import typer

from weberlink.cli.output import errors

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
    from weberlink.config import ConfigurationError  # noqa: PLC0415 - not for the help

    if text is None:
        return None
    names = tuple(dict.fromkeys(part.strip().lower() for part in text.split(",")))
    for name in names:
        if name not in FORMATS:
            raise ConfigurationError(f"--format: {name!r} is none of {', '.join(FORMATS)}")
    return names


def known_formats(value: str | None) -> str | None:
    """Refuse an unknown format before anything is computed."""
    with errors():
        formats_of(value)
    return value


Footer = Annotated[
    bool,
    typer.Option("--footer/--no-footer", help="Print the environment below figures; their metadata always have it."),
]
Format = Annotated[
    str | None,
    typer.Option(
        "--format",
        metavar="F,..",
        callback=known_formats,
        help="Formats of figures: png, pdf, svg; default: the usual.",
    ),
]
