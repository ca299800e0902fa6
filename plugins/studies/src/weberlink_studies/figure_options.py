"""Options of the commands that draw figures."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from weberlink.cli.output import errors


def known_formats(value: str | None) -> str | None:
    """Refuse an unknown format before anything is computed."""
    if value is not None:
        from weberlink_studies.drawing import formats_of  # noqa: PLC0415 - not for the help

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


@contextmanager
def figures(footer: bool, formats: str | None) -> Iterator[None]:
    """All figures within are drawn with these options."""
    from weberlink_studies.drawing import Drawing, drawn_as, formats_of  # noqa: PLC0415 - not for the help

    with drawn_as(Drawing(footer, formats_of(formats))):
        yield
