"""When the monitor's program ends, and how it opens a browser."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from urllib.parse import unquote, urlsplit

from weberlink.apps.monitor.program import end_when_left, leading_to

LIMIT_S, LOOK_S = 0.3, 0.01


def visit(act: Callable[[list[str]], Awaitable[None]]) -> tuple[bool, list[str]]:
    """Whether the visit has ended when `act`, which opens and closes pages, returns; and what was said."""

    async def run() -> tuple[bool, list[str]]:
        pages: list[str] = []
        said: list[str] = []
        over = asyncio.Event()
        task = asyncio.get_running_loop().create_task(end_when_left(pages, LIMIT_S, over, said.append, LOOK_S))
        await act(pages)
        is_over = over.is_set()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return is_over, said

    return asyncio.run(run())


async def pause(share: float) -> None:
    await asyncio.sleep(share * LIMIT_S)


def test_page_that_is_opened_again_or_another_one_ends_nothing() -> None:
    async def act(pages: list[str]) -> None:
        for _ in range(5):
            pages.append("a page")
            await pause(0.2)
            pages.clear()
            await pause(0.4)
        pages.extend(["a page", "another"])
        await pause(0.2)
        pages.pop()
        await pause(2.0)

    assert visit(act) == (False, [])


def test_page_that_stays_closed_ends_the_visit_with_one_line() -> None:
    async def act(pages: list[str]) -> None:
        pages.append("a page")
        await pause(0.5)
        pages.clear()
        await pause(3.0)

    is_over, said = visit(act)
    assert is_over and len(said) == 1 and f"{LIMIT_S:g} s" in said[0]


def test_browser_gets_the_key_from_a_file_of_this_user_alone() -> None:
    url = "http://127.0.0.1:8724/#key=secret"
    with leading_to(url) as opened:
        path = Path(unquote(urlsplit(opened).path))
        assert "secret" not in opened and f"url={url}" in path.read_text()
        assert path.stat().st_mode & 0o077 == 0
    assert not path.exists()
