"""Exceptions of hardware."""


class HardwareFault(RuntimeError):  # noqa: N818 - a fault is what the user meets, an error is ours
    """Hardware cannot be used; one line that says what is wrong and, if known, what to do."""


class BadReply(HardwareFault):
    """One answer was missing, late or malformed; the next one may be good."""
