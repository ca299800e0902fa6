"""What must hold in a trial that runs as a program."""

import sys


def write(line: str = "") -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


class Laws:
    """Prints each law as it is checked, and keeps those that are broken."""

    def __init__(self) -> None:
        self.broken: list[str] = []

    def check(self, law: str, holds: bool, figure: object = "") -> None:
        write(f"{'ok    ' if holds else 'BROKEN'} {law}{f': {figure}' if figure != '' else ''}")
        if not holds:
            self.broken.append(law)
