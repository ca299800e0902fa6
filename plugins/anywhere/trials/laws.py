"""What must hold in a trial that runs as a program."""

import sys
from textwrap import wrap

INDENT = " " * 7  # under a law, behind its "ok" or "BROKEN"
COLUMNS = 80


def write(line: str = "") -> None:
    """Print a line; a longer one than the terminal is wide goes on below."""
    told = line if len(line) <= COLUMNS else "\n".join(wrap(line, COLUMNS, subsequent_indent=INDENT))
    sys.stdout.write(f"{told}\n")
    sys.stdout.flush()


class Laws:
    """Prints each law as it is checked, and keeps those that are broken."""

    def __init__(self) -> None:
        self.broken: list[str] = []

    def check(self, law: str, holds: bool, figure: object = "") -> None:
        write(f"{'ok    ' if holds else 'BROKEN'} {law}{f': {figure}' if figure != '' else ''}")
        if not holds:
            self.broken.append(law)
