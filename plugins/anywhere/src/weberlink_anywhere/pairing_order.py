"""What a command asks of the process that pairs two hosts, and how it starts it.

The process reads the order from its standard input, and ends when that is closed. It writes one JSON object per line:

| key | value |
|---|---|
| `code` | the code that it made, to be shown |
| `note` | what happens, for the user |
| `paired` | label of the new peer; the end |
| `refused` | why there is none; the end |
"""

import json
import subprocess
from dataclasses import asdict, dataclass

from weberlink.child_process import python


@dataclass(frozen=True)
class PairingOrder:
    """Whom to pair with.

    Args:
        side: of this host, "master" or "slave".
        name: of this host.
        store: folder of the known peers.
        mailbox: URL of the mailbox server.
        code: that the other host shows; "" to make one.
        label: what to call the peer; "" for its own name.
        lifetime_s: how long a code that is made here waits for the other host.
        patience_s: how long the mailbox, or a host that is there, may take for an answer.
    """

    side: str
    name: str
    store: str
    mailbox: str
    code: str = ""
    label: str = ""
    lifetime_s: float = 600.0
    patience_s: float = 20.0

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "PairingOrder":
        return cls(**json.loads(text))


def start_pairing(order: PairingOrder) -> subprocess.Popen[str]:
    """Start the process; Ctrl-C on the terminal does not reach it."""
    process = subprocess.Popen(  # noqa: S603
        python("-m", "weberlink_anywhere.pairing"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdin is not None
    process.stdin.write(order.to_json() + "\n")
    process.stdin.flush()
    return process
