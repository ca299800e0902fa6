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
from types import TracebackType
from typing import Self

from plugins.anywhere.tests.mailbox_server import MailboxServer
from plugins.anywhere.tests.namespaces import SERVER, SERVER_NAME, Namespace
from tests.wait import PATIENCE

NONE, CONE, SYMMETRIC, BLOCKED = "none", "cone", "symmetric", "blocked"
NATS = (NONE, CONE, SYMMETRIC, BLOCKED)
"""Kinds of NAT. Cone: one mapping for all destinations (RFC 4787 "endpoint-independent"), at another port than the
host's own. Symmetric: one for each destination. Both pass inwards only what answers (address and port-dependent
filtering). Blocked: a cone NAT that drops UDP. None: public addresses, no filter."""
SECOND_SERVER = "203.0.113.2"
"""The relay has two addresses, so that kinds of NAT can be told apart (RFC 5780)."""
RELAY = Path(__file__).parents[1] / "configs" / "relay" / "relay.sh"
TURN_PORT, MAILBOX_PORT = 3478, 4000
MAILBOX_URL = f"ws://{SERVER_NAME}:{MAILBOX_PORT}/v1"
SECRET = "secret-of-the-test-bed"
FIRST, SECOND = "wifi", "phone"
"""Network interfaces of a host."""

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
    """The way of one network interface of a host to the public net.

    Args:
        space: that of the router.
        number: unique in an internet, 1 to 15.
        nat: one of `NATS`.
        interface: name of the interface at the host.
    """

    def __init__(
        self, public: Namespace, host: Namespace, space: Namespace, number: int, nat: str, interface: str
    ) -> None:
        self.nat, self.space = nat, space
        self._number, self._public, self._host, self._interface = number, public, host, interface
        self.outside = f"203.0.113.{10 + number}"
        lan, self._size = (f"198.51.100.{16 * number}", 28) if nat == NONE else _PRIVATE[interface]
        self._base, last = lan.rsplit(".", 1)
        self._first = int(last) + 1
        self.address = f"{self._base}.{self._first + 1}"
        """That of the host."""
        self._connect()
        self.space.set_sysctl("ipv4/ip_forward", 1)
        self.space.nft(_RULES[nat])

    def _connect(self) -> None:
        gateway = f"{self._base}.{self._first}"
        port = f"port{self._number}"
        self._public.ip(
            f"link add {port} type veth peer name outside netns {self.space.name}", f"link set {port} master net up"
        )
        self.space.ip(
            f"link add inside type veth peer name {self._interface} netns {self._host.name}",
            f"addr add {self.outside}/24 dev outside",
            f"addr add {gateway}/{self._size} dev inside",
            "link set inside up",
            "link set outside up",
            f"route add default via {SERVER}",
        )
        if self.nat == NONE:
            self._public.ip(f"route add {self._base}.{self._first - 1}/{self._size} via {self.outside}")
        self.connect_host()

    def connect_host(self) -> None:
        """Plug the host in, also again after `unplug`."""
        # An interface with a larger number is the second choice of a host that does not name one.
        self._host.ip(
            f"addr replace {self.address}/{self._size} dev {self._interface}",
            f"link set {self._interface} up",
            f"route replace default via {self._base}.{self._first} dev {self._interface} "
            f"metric {100 if self._interface == FIRST else 200}",
        )

    def unplug(self) -> None:
        """Take the host's interface down."""
        self._host.ip(f"link set {self._interface} down")

    def readdress(self) -> None:
        """Give the host another address in its net, as a DHCP server may."""
        before = self.address
        last = int(before.rsplit(".", 1)[1])
        self.address = f"{self._base}.{last + 1}"
        self._host.ip(f"addr del {before}/{self._size} dev {self._interface}")
        self.connect_host()

    def renumber(self) -> None:
        """Give the router another public address, as a provider may; all mappings are lost."""
        before, self.outside = self.outside, f"203.0.113.{int(self.outside.rsplit('.', 1)[1]) + 100}"
        self.space.ip(
            f"addr del {before}/24 dev outside",
            f"addr add {self.outside}/24 dev outside",
            f"route replace default via {SERVER}",
        )
        if self.nat == NONE:
            self._public.ip(f"route replace {self._base}.{self._first - 1}/{self._size} via {self.outside}")
        else:
            self.space.forget_connections()

    def forget(self) -> None:
        """Lose all mappings; the next datagram of the host gets another one."""
        self.space.forget_connections()

    def set_silent(self, is_silent: bool) -> None:
        """Pass nothing, without any sign of it at the host."""
        self.space.ip(f"link set outside {'down' if is_silent else 'up'}")
        if not is_silent:
            self.space.ip(f"route replace default via {SERVER}")

    def set_timeout(self, seconds: int) -> None:
        """How long an unused mapping lives."""
        self.space.set_sysctl("netfilter/nf_conntrack_udp_timeout", seconds)
        self.space.set_sysctl("netfilter/nf_conntrack_udp_timeout_stream", seconds)


_PRIVATE = {FIRST: ("192.168.1.0", 24), SECOND: ("10.64.0.0", 24)}


class Home:
    """A host, and its router for each interface."""

    def __init__(self, host: Namespace, first: Router, second: Router | None) -> None:
        self.space, self.first, self.second = host, first, second

    @property
    def prefix(self) -> tuple[str, ...]:
        """The command that runs another command on the host."""
        return self.space.prefix


class Relay:
    """coturn as shipped (configs/relay), in a namespace, with `SECRET`.

    Args:
        folder: for its secret and configuration.
    """

    def __init__(self, space: Namespace, folder: Path) -> None:
        self._space = space
        self._folder = folder
        self._process: subprocess.Popen[bytes] | None = None
        secret = folder / "turn.secret"
        secret.touch(mode=0o600)
        secret.write_text(SECRET)
        addresses = (f"--listening-ip={SERVER}", f"--listening-ip={SECOND_SERVER}", f"--relay-ip={SERVER}")
        self._command = (*space.prefix, str(RELAY), str(secret), *addresses)

    def start(self) -> None:
        """Start it, and wait until it answers."""
        with (self._folder / "log").open("wb") as log:
            self._process = subprocess.Popen(
                self._command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env={**os.environ, "RUNTIME_DIRECTORY": str(self._folder)},
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
        """Kill it; all allocations are lost."""
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

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stack.close()

    def home(self, nat: str, second: str | None = None) -> Home:
        """Connect a host behind a NAT; with `second`, also by another interface behind a NAT of that kind."""
        host = self._space(f"h{self._routers + 1}")
        first = self._router(host, nat, FIRST)
        return Home(host, first, self._router(host, second, SECOND) if second else None)

    def start_relay(self) -> Relay:
        """Start coturn at `SERVER`."""
        folder = Path(self._stack.enter_context(TemporaryDirectory(prefix="wl-relay-")))
        relay = Relay(self.public, folder)
        self._stack.callback(relay.stop)
        relay.start()
        return relay

    def start_mailbox(self) -> MailboxServer:
        """Start the mailbox server at `SERVER`."""
        return self._stack.enter_context(MailboxServer(SERVER, MAILBOX_PORT, self.public.prefix))

    def _space(self, role: str) -> Namespace:
        space = Namespace(role)
        self._stack.callback(space.delete)
        return space

    def _router(self, host: Namespace, nat: str, interface: str) -> Router:
        self._routers += 1
        space = self._space(f"r{self._routers}")
        return Router(self.public, host, space, self._routers, nat, interface)
