"""The two ends of a link and what people call them. Knows nothing of what either does."""

from enum import Enum


class Role(Enum):
    """Which end of the link an endpoint is; the value is its name in messages to people."""

    INITIATOR = "master"
    RESPONDER = "slave"

    @property
    def other(self) -> "Role":
        return Role.RESPONDER if self is Role.INITIATOR else Role.INITIATOR
