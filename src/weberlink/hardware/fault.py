"""Exceptions of hardware."""


class HardwareFault(RuntimeError):  # noqa: N818 - a fault is what the user meets, an error is ours
    """Hardware cannot be used, or no longer; one line that says what and, where it is known, what to do."""


class BadReply(HardwareFault):
    """One answer was missing, late or not what the protocol says; the next one may be good again."""
