"""The bounded queue of a page."""

import asyncio

from hypothesis import given
from hypothesis import strategies as st

from weberlink.apps.monitor.viewer import ANSWERS_WAITING, GREETINGS_WAITING, ROWS_WAITING, MessageKind, Viewer

BOUND = ROWS_WAITING + ANSWERS_WAITING + 2 * GREETINGS_WAITING + 4


def drained(viewer: Viewer) -> list[str]:
    taken = []
    while (text := viewer.take()) is not None:
        taken.append(text)
    return taken


@given(st.lists(st.sampled_from(list(MessageKind)), max_size=600))
def test_queue_is_bounded_and_keeps_the_newest(kinds: list[MessageKind]) -> None:
    viewer = Viewer(None, may_change=False)
    for number, kind in enumerate(kinds):
        viewer.put(kind, f"{kind.name} {number}")
        assert len(viewer) <= BOUND
    left = drained(viewer)
    for is_answer in (True, False):
        numbers = [int(text.split()[1]) for text in left if text.startswith("ANSWER") == is_answer]
        assert numbers == sorted(numbers)
    for kind in (MessageKind.HELLO, MessageKind.AGAIN, MessageKind.ANSWER, MessageKind.FINAL):
        put = [number for number, each in enumerate(kinds) if each is kind]
        if put:
            assert f"{kind.name} {put[-1]}" in left


def test_slow_page_loses_rows_but_no_figures() -> None:
    viewer = Viewer(None, may_change=False)
    viewer.put(MessageKind.HELLO, "hello")
    for number in range(1000):
        viewer.put(MessageKind.ROWS, f"rows {number}")
        if number % 10 == 0:
            viewer.put(MessageKind.FIGURES, f"figures {number}")
    viewer.put(MessageKind.FINAL, "final")
    left = drained(viewer)
    assert left[0] == "hello" and left[-1] == "final"
    assert left[1:-1] == [f"rows {number}" for number in range(1000 - ROWS_WAITING, 1000)]
    assert viewer.lost_rows == 1000 - ROWS_WAITING


def test_final_figures_precede_the_next_greeting() -> None:
    viewer = Viewer(None, may_change=False)
    for kind, text in (
        (MessageKind.ROWS, "old"),
        (MessageKind.FINAL, "final"),
        (MessageKind.HELLO, "next"),
        (MessageKind.ROWS, "new"),
    ):
        viewer.put(kind, text)
    assert drained(viewer) == ["final", "next", "new"]


def test_repeated_greeting_keeps_the_rows() -> None:
    viewer = Viewer(None, may_change=False)
    for kind, text in ((MessageKind.HELLO, "one side"), (MessageKind.ROWS, "rows"), (MessageKind.AGAIN, "both sides")):
        viewer.put(kind, text)
    assert drained(viewer) == ["one side", "rows", "both sides"]


def test_answers_overtake_rows() -> None:
    viewer = Viewer(None, may_change=True)
    for kind, text in (
        (MessageKind.ROWS, "rows"),
        (MessageKind.HANDLE, "taken"),
        (MessageKind.ANSWER, "stopped"),
        (MessageKind.ROWS, "more rows"),
        (MessageKind.HANDLE, "free"),
    ):
        viewer.put(kind, text)
    assert drained(viewer) == ["stopped", "rows", "more rows", "free"]


def test_new_message_wakes_the_sender() -> None:
    async def run() -> str:
        viewer = Viewer(None, may_change=False)
        messages = viewer.messages()
        first = asyncio.ensure_future(anext(messages))
        await asyncio.sleep(0)
        viewer.put(MessageKind.ANSWER, "late")
        return await first

    assert asyncio.run(run()) == "late"
