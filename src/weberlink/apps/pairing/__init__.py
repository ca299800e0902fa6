"""Pair two hosts by a code: `pair` for the commands `slave --invite` and `master --join`."""

from weberlink.system.configuration import Configuration


def pair(configuration: Configuration, side: str, code: str, label: str | None) -> str:
    """Pair this host with another one, and keep the peer.

    Args:
        configuration: of this side; names the mailbox server.
        side: master or slave.
        code: that the other host shows; "" to make one and show it.
        label: what to call the peer; None for its own name.

    Returns:
        The label of the new peer.

    Raises:
        ConfigurationError: there is no mailbox in the file, a package is missing, or the two did not pair; says why.
    """
    raise NotImplementedError
