"""When the monitor's program ends, and how it opens a browser."""

import asyncio

import pytest

from weberlink_page import program
from weberlink_page.program import end_when_left

LIMIT_S = 60.0


class Pages:
    """How many pages are open; each look takes a second."""

    def __init__(self, opened: list[tuple[float, float]], until: float) -> None:
        self.now, self._opened, self._until = 0.0, opened, until

    def __len__(self) -> int:
        self.now += 1.0
        if self.now > self._until:
            raise EOFError
        return sum(begin <= self.now < end for begin, end in self._opened)


@pytest.mark.parametrize(
    ("opened", "ends_at"),
    [
        ([], None),  # nobody has come yet
        ([(5, 10), (69, 80), (139, 1000)], None),  # opened again just within the time
        ([(5, 1000), (5, 20)], None),  # another one
        ([(5, 10)], 70),
        ([(5, 10), (71, 80)], 70),
    ],
)
def test_page_that_stays_closed_ends_the_visit(
    opened: list[tuple[float, float]], ends_at: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    pages, said = Pages(opened, 500.0), list[str]()
    monkeypatch.setattr(program, "monotonic", lambda: pages.now)

    async def run() -> bool:
        over = asyncio.Event()
        try:
            await end_when_left(pages, LIMIT_S, over, said.append, 0.0)
        except EOFError:
            assert not over.is_set()
        return over.is_set()

    assert asyncio.run(run()) is (ends_at is not None)
    assert len(said) == (ends_at is not None)
    assert ends_at is None or pages.now == pytest.approx(ends_at, abs=1.0)
