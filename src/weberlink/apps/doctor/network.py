"""The way of the datagrams: buffers, the port of the slave, the address that the master calls."""

from collections.abc import Iterator
from ipaddress import ip_address, ip_network

from weberlink.apps.doctor.finding import Check, Finding, advice, ok, problem, unknown
from weberlink.apps.doctor.host import Host, Unreadable
from weberlink.apps.doctor.needs import Needs

CHARGED_BYTES = 832
"""What the kernel charges a receive buffer for a datagram of ours that came over loopback (Linux 6.18, x86-64: 256 of
them fill 212992 bytes). A network card whose driver keeps larger buffers is charged more."""
EXAMPLES = [ip_network(text) for text in ("192.0.2.0/24", "198.51.100.0/24", "203.0.113.0/24", "2001:db8::/32")]
"""Addresses for documentation (RFC 5737, RFC 3849), which nobody has."""


def receive_buffer(host: Host, needs: Needs) -> Iterator[Finding]:
    """Whether a stall as long as the silence limit overflows a socket that gets an update at every tick."""
    size = host.number("/proc/sys/net/core/rmem_default")
    largest = host.number("/proc/sys/net/core/rmem_max")
    holds_ms = 1e3 * size / CHARGED_BYTES / needs.rate_hz
    found = f"UDP receive buffer {size} B holds {holds_ms:.0f} ms of an update a tick"
    if holds_ms >= 1e3 * needs.silence_s:
        yield ok("receive buffer", f"{found} (limit {largest} B)")
    else:
        wanted = int(2 * needs.silence_s * needs.rate_hz * CHARGED_BYTES)
        yield advice("receive buffer", found, f"sudo sysctl -w net.core.rmem_default={wanted}")


def port(host: Host, needs: Needs) -> Iterator[Finding]:
    """Whether the slave's port is free, or who has it."""
    if needs.listen is None:
        yield ok("port", "no fixed UDP port to listen on here")
        return
    address, number = needs.listen
    try:
        host.bind(address, number)
    except OSError as error:
        yield _taken(host, address, number, error)
    else:
        yield ok("port", f"UDP port {number} is free")


def _taken(host: Host, address: str, number: int, error: OSError) -> Finding:
    holder = _holder(host, number)
    if holder and "weberlink.system.daemon" in holder:
        return ok("port", f"UDP port {number} is held by a weberlink daemon that runs")
    if holder or _is_listed(host, number):
        by = f" by {holder.split()[0]}" if holder else ""
        return problem("port", f"UDP port {number} is in use{by}", f"see who has it: sudo ss -lunp 'sport = :{number}'")
    return problem(
        "port",
        f"UDP {address}:{number} cannot be listened on: {error.strerror}",
        "in the file: link.listen, with 0.0.0.0 or an address of `ip -brief address`",
    )


def _inodes(host: Host, number: int) -> set[str]:
    """Of sockets with this local port: in /proc/net/udp the second column ends in the port, the tenth is the inode."""
    inodes: set[str] = set()
    for path in ("/proc/net/udp", "/proc/net/udp6"):
        try:
            lines = host.read(path).splitlines()[1:]
        except Unreadable:
            continue
        rows = (line.split() for line in lines)
        inodes.update(row[9] for row in rows if len(row) > 9 and int(row[1].rpartition(":")[2], 16) == number)
    return inodes


def _is_listed(host: Host, number: int) -> bool:
    return bool(_inodes(host, number))


def _holder(host: Host, number: int) -> str:
    """The command line of the process that has the port; empty if this user may not see it."""
    sockets = {f"socket:[{inode}]" for inode in _inodes(host, number)}
    for link in (host.root / "proc").glob("[0-9]*/fd/*"):
        try:
            if str(link.readlink()) in sockets:
                command = (link.parents[1] / "cmdline").read_bytes()
                return " ".join(command.decode(errors="replace").split("\0")).strip()
        except OSError:
            continue
    return ""


def slave_address(host: Host, needs: Needs) -> Iterator[Finding]:
    """Whether the master can find the slave's host."""
    if needs.slave is None:
        yield ok("slave address", "no slave to be called from here")
        return
    name = needs.slave[0]
    try:
        addresses = host.resolve(name)
    except OSError as error:
        yield problem("slave address", f"{name} cannot be resolved: {error.strerror}", _place(name))
        return
    address = addresses[0]
    if any(ip_address(address.partition("%")[0]) in network for network in EXAMPLES):
        yield problem("slave address", f"link.slave is {name}, an address for examples", _place(name))
        return
    try:
        own = host.route(address)
    except OSError as error:
        yield problem("slave address", f"no way to {name}: {error.strerror}", f"ip route get {address}")
        return
    yield from _answer(host, name, address, own)


def _answer(host: Host, name: str, address: str, own: str) -> Iterator[Finding]:
    """A slave itself answers nobody without the key, so its host is asked."""
    if ip_address(address.partition("%")[0]).is_loopback or address == own:
        yield ok("slave address", f"{name} is this host")
        return
    way = f"{name}: route from {own}"
    if host.which("ping") is None:
        yield ok("slave address", f"{way}; whether it answers was not tried (no ping)")
        return
    status, _ = host.run("ping", "-n", "-c", "1", "-W", "1", address)
    if status == 0:
        yield ok("slave address", f"{way}, answers a ping")
    else:
        yield unknown(
            "slave address", f"{way}; no answer to a ping, which a firewall may cause", f"ping -c 3 {address}"
        )


def _place(name: str) -> str:
    return f"in the file: link.slave: ROBOT:PORT (not {name}), or --set link.slave=ROBOT:PORT"


CHECKS: tuple[Check, ...] = (receive_buffer, port, slave_address)
