"""The bounded queue of a page."""

import json
from typing import get_args

from hypothesis import given
from hypothesis import strategies as st

from weberlink_page.viewer import ANSWERS_WAITING, MOST_WAITING, OUTLIVING, Topic, Viewer

TOPICS = get_args(Topic)
BOUND = sum(MOST_WAITING.get(topic, 1) for topic in TOPICS) + ANSWERS_WAITING


def told(text: str) -> dict[str, str]:
    return {"type": "answer", "text": text}


def drained(viewer: Viewer) -> list[str]:
    return [json.loads(text)["text"] for text in iter(viewer.take, None)]


@given(st.lists(st.sampled_from([*TOPICS, "answer"]), max_size=600))
def test_queue_is_bounded_and_keeps_the_newest(topics: list[str]) -> None:
    viewer = Viewer(None, may_change=False)
    for number, topic in enumerate(topics):
        text = f"{topic} {number}"
        if topic == "hello":
            viewer.greet(told(text))
        elif topic == "answer":
            viewer.answer(told(text))
        else:
            viewer.put(topic, told(text))
        assert len(viewer) <= BOUND
    left = drained(viewer)
    for is_answer in (True, False):
        numbers = [int(text.split()[1]) for text in left if text.startswith("answer") == is_answer]
        assert numbers == sorted(numbers)
    greeted = max((number for number, topic in enumerate(topics) if topic == "hello"), default=-1)
    for topic in {*TOPICS, "answer"}:
        put = [number for number, each in enumerate(topics) if each == topic]
        if put and (topic in (*OUTLIVING, "answer") or put[-1] >= greeted):
            assert f"{topic} {put[-1]}" in left
        elif put:
            assert not any(text.startswith(f"{topic} ") for text in left)
