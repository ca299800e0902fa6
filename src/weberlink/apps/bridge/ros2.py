"""Placeholder."""


def run(session: str | None) -> None:
    raise NotImplementedError
