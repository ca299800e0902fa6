"""A page that is shown one scripted session after the other: to load it anew takes most of a second."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

from tests.apps.monitor import synthetic_session as session
from tests.apps.monitor.browser import Browser
from tests.apps.monitor.scripted_server import Message, ScriptedServer

NUMBERS = count(1)


@contextmanager
def unasked(page: Browser, server: ScriptedServer) -> Iterator[ScriptedServer]:
    """The server, of which nothing was asked yet; a test that stops it leaves no page behind."""
    server.answer = lambda _: None
    server.greeting, server.sessions, server.pictures = [], [], []
    for noted in (server.asked, server.posted, server.followed):
        noted.clear()  # type: ignore[attr-defined]
    yield server
    if not server.serves:
        server.start()
        leave(page)


def leave(page: Browser) -> None:
    """Close the page, whose choices the next test is not to find."""
    page.driver.get("about:blank")


def visit(page: Browser, server: ScriptedServer, *messages: Message, anew: bool = False) -> None:
    """Tell the page these, and wait until it shows the greeting.

    The page is loaded `anew`, or if it is not there; it is then told when it connects. Otherwise it first shows another
    session, of which there are no rows.
    """
    server.greeting = list(messages)
    if anew or page.driver.current_url != server.address:
        page.open(server.address)
        page.wait(lambda: server.pages > 0, "the page to connect")
    else:
        page.forget_console()
        name = f"before-{next(NUMBERS)}"
        server.say(session.hello(session=name, names={"file": name}))
        page.wait(lambda: name in page.driver.title and page.data("state") == "connecting", "a session without rows")
        server.say(*messages)
        page.wait(lambda: name not in page.driver.title, "the greeting")
    if messages and messages[0]["session"]:
        page.wait(lambda: page.picked("session") == messages[0]["session"], "the greeting to be shown")
