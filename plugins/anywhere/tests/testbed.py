"""An internet in network namespaces: homes behind NAT of every kind, a relay and a mailbox in between.

    with Internet() as internet:
        internet.start_relay()
        lab, home = internet.home(CONE), internet.home(SYMMETRIC, second=CONE)
        subprocess.run([*lab.prefix, "weberlink", "slave", ...])

Linux is the router of each home: nftables translates addresses, and connection tracking keeps the mappings. Processes
in a namespace find the public servers under the name `relay.example`. Two homes use the same private addresses, as
homes do. All ends with the block: processes in the namespaces, the namespaces and their files.
"""

import os
import socket
import subprocess
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import NamedTuple, Self

from plugins.anywhere.tests.mailbox_server import MailboxServer
from plugins.anywhere.tests.namespaces import SERVER, SERVER_NAME, Namespace
from tests.wait import PATIENCE

NONE, CONE, SYMMETRIC, BLOCKED = "none", "cone", "symmetric", "blocked"
NATS = (NONE, CONE, SYMMETRIC, BLOCKED)
"""Kinds of NAT. Cone: one mapping for all destinations (RFC 4787 "endpoint-independent"), at another port than the
host's own. Symmetric: one for each destination. Both pass inwards only what answers (address and port-dependent
filtering). Blocked: a cone NAT that drops UDP. None: public addresses, no filter."""
SECOND_SERVER = "203.0.113.2"  # the relay has two addresses, so that kinds of NAT can be told apart (RFC 5780)
RELAY = Path(__file__).parents[1] / "configs" / "relay" / "relay.sh"
TURN_PORT, MAILBOX_PORT = 3478, 4000
MAILBOX_URL = f"ws://{SERVER_NAME}:{MAILBOX_PORT}/v1"
SECRET = "secret-of-the-test-bed"
FIRST, SECOND = "wifi", "phone"  # network interfaces of a host

_NAT = """
table ip home {
    chain arriving {
        type filter hook input priority filter; policy drop;
        iifname != "outside" accept
        ct state established,related accept
    }
    chain passing {
        type filter hook forward priority filter; policy drop;
        %(passing)s
        iifname "inside" accept
        ct state established,related accept
    }
    chain leaving {
        type nat hook postrouting priority srcnat;
        oifname "outside" meta l4proto udp masquerade %(how)s
        oifname "outside" masquerade
    }
}
"""
# A NAT that accepted a stranger's datagram itself would remember its ports, and give the host another mapping.
_RULES = {
    NONE: "",
    # Local ports start at 32768, so no mapping keeps the port of the host.
    CONE: _NAT % {"passing": "", "how": "to :1024-32767"},
    SYMMETRIC: _NAT % {"passing": "", "how": "random,fully-random"},
    BLOCKED: _NAT % {"passing": "meta l4proto udp drop", "how": ""},
}


class Router:
    """The way of one network interface of a host to the public net; `number` is unique in an internet, 1 to 15."""

    def __init__(
        self, public: Namespace, host: Namespace, space: Namespace, number: int, nat: str, interface: str
    ) -> None:
        self.space, self.host, self.interface = space, host, interface
        self.outside = f"203.0.113.{10 + number}"
        net, self.size = (f"198.51.100.{16 * number}", 28) if nat == NONE else _PRIVATE[interface]
        base, last = net.rsplit(".", 1)
        self.gateway, self.address = (f"{base}.{int(last) + each}" for each in (1, 2))
        """Of the router inside, and of the host."""
        port = f"port{number}"
        public.ip(f"link add {port} type veth peer name outside netns {space.name}", f"link set {port} master net up")
        space.ip(
            f"link add inside type veth peer name {interface} netns {host.name}",
            f"addr add {self.outside}/24 dev outside",
            f"addr add {self.gateway}/{self.size} dev inside",
            "link set inside up",
            "link set outside up",
            f"route add default via {SERVER}",
        )
        if nat == NONE:
            public.ip(f"route add {net}/{self.size} via {self.outside}")
        self.connect_host()
        space.set_sysctl("ipv4/ip_forward", 1)
        space.nft(_RULES[nat])

    def connect_host(self) -> None:
        # An interface with a larger number is the second choice of a host that does not name one.
        self.host.ip(
            f"addr replace {self.address}/{self.size} dev {self.interface}",
            f"link set {self.interface} up",
            f"route replace default via {self.gateway} dev {self.interface} "
            f"metric {100 if self.interface == FIRST else 200}",
        )


_PRIVATE = {FIRST: ("192.168.1.0", 24), SECOND: ("10.64.0.0", 24)}


class Home(NamedTuple):
    space: Namespace
    first: Router
    second: Router | None

    @property
    def prefix(self) -> tuple[str, ...]:
        return self.space.prefix


class Relay:
    """coturn as shipped (configs/relay), in a namespace, with `SECRET`."""

    def __init__(self, space: Namespace, folder: Path) -> None:
        self._space, self._folder = space, folder
        self._process: subprocess.Popen[bytes] | None = None
        secret = folder / "turn.secret"
        secret.touch(mode=0o600)
        secret.write_text(SECRET)
        addresses = (f"--listening-ip={SERVER}", f"--listening-ip={SECOND_SERVER}", f"--relay-ip={SERVER}")
        self._command = (*space.prefix, str(RELAY), str(secret), *addresses)

    def start(self) -> None:
        environment = {**os.environ, "RUNTIME_DIRECTORY": str(self._folder)}
        with (self._folder / "log").open("wb") as log:
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment
            )
        with self._space.entered():
            asking = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with asking:
            asking.settimeout(0.05)
            deadline = monotonic() + PATIENCE
            while self._process.poll() is None and monotonic() < deadline:
                # A binding request without attributes (RFC 8489 section 5).
                asking.sendto(bytes.fromhex("000100002112a442") + b"weberlink-up", (SERVER, TURN_PORT))
                with suppress(OSError):
                    asking.recv(2048)
                    return
        self.stop()
        raise RuntimeError(f"the relay did not start: {(self._folder / 'log').read_text(errors='replace')}")

    def stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


class Internet:
    """The public net: servers, and homes that are connected to it."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._routers = 0

    def __enter__(self) -> Self:
        try:
            self.public = self._space("net")
            self.public.ip(
                # An address of its own: otherwise a new port may change it, and routers keep the old one for a while.
                "link add net address 02:00:00:00:00:01 type bridge forward_delay 0",
                f"addr add {SERVER}/24 dev net",
                f"addr add {SECOND_SERVER}/24 dev net",
                "link set net up",
                # Private addresses lead nowhere.
                "route add blackhole default",
            )
            self.public.set_sysctl("ipv4/ip_forward", 1)
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def home(self, nat: str, second: str | None = None) -> Home:
        """Connect a host behind a NAT; with `second`, also by another interface behind a NAT of that kind."""
        host = self._space(f"h{self._routers + 1}")
        first = self._router(host, nat, FIRST)
        return Home(host, first, self._router(host, second, SECOND) if second else None)

    def start_relay(self) -> Relay:
        folder = Path(self._stack.enter_context(TemporaryDirectory(prefix="wl-relay-")))
        relay = Relay(self.public, folder)
        self._stack.callback(relay.stop)
        relay.start()
        return relay

    def start_mailbox(self) -> MailboxServer:
        return self._stack.enter_context(MailboxServer(SERVER, MAILBOX_PORT, self.public.prefix))

    def _space(self, role: str) -> Namespace:
        space = Namespace(role)
        self._stack.callback(space.delete)
        return space

    def _router(self, host: Namespace, nat: str, interface: str) -> Router:
        self._routers += 1
        space = self._space(f"r{self._routers}")
        return Router(self.public, host, space, self._routers, nat, interface)
