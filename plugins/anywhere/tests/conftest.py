"""A mailbox server on this host; and an internet in namespaces, with relay and mailbox, for the tests of a module."""

from collections.abc import Iterator

import pytest

from plugins.anywhere.tests.mailbox_server import MailboxServer
from plugins.anywhere.tests.testbed import Internet


@pytest.fixture(scope="session")
def mailbox() -> Iterator[MailboxServer]:
    pytest.importorskip("wormhole_mailbox_server")
    with MailboxServer() as server:
        yield server


@pytest.fixture(scope="module")
def internet() -> Iterator[Internet]:
    with Internet() as internet:
        internet.start_relay()
        internet.start_mailbox()
        yield internet
