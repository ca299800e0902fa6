"""The mailbox server of all tests of pairing."""

from tests.anywhere.mailbox_server import mailbox

__all__ = ["mailbox"]
