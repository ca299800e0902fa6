"""Network and key file: receive buffer, port, slave address, firewall, pre-shared key."""

import shlex
import stat
from ipaddress import ip_address

from weberlink.cli.doctor.machine import Machine
from weberlink.cli.doctor.needs import Needs
from weberlink.cli.doctor.report import Finding, advice, ok, problem, unknown
from weberlink.config.model import is_placeholder
from weberlink.protocol import keys
from weberlink.telemetry.runtime_directory import user_name

CHARGED_BYTES = 832
"""What the kernel charges a receive buffer for a datagram of ours that came over loopback (Linux 6.18, x86-64: 256 of
them fill 212992 bytes). A network card whose driver keeps larger buffers is charged more."""
FIREWALL_TOOLS = {
    "ufw": "sudo ufw status | grep -w {port}    (to open it: sudo ufw allow {port}/udp)",
    "firewall-cmd": "sudo firewall-cmd --query-port={port}/udp    (to open it: --add-port={port}/udp)",
    "nft": "sudo nft list ruleset | grep -w -e drop -e reject -e {port}",
    "iptables": "sudo iptables -S INPUT | grep -w -e DROP -e REJECT -e {port}",
}
"""How to see whether a UDP port is open, by tool; the first one installed is named."""


def receive_buffer(machine: Machine, needs: Needs) -> Finding:
    """Whether the socket holds all updates of a stall as long as the silence limit, at one update per tick."""
    size, largest = (machine.number(f"/proc/sys/net/core/rmem_{name}") for name in ("default", "max"))
    holds_ms = 1e3 * size / CHARGED_BYTES / needs.rate_hz
    found = f"UDP receive buffer {size} B holds {holds_ms:.0f} ms at one update per tick"
    if holds_ms >= 1e3 * needs.silence_s:
        return ok(f"{found} (limit {largest} B)")
    wanted = int(2 * needs.silence_s * needs.rate_hz * CHARGED_BYTES)
    return advice(found, f"sudo sysctl -w net.core.rmem_default={wanted}")


def port(machine: Machine, needs: Needs) -> Finding:
    """Whether the slave's port is free, or which process has it."""
    if needs.listen is None:
        return ok("no fixed UDP port to listen on here")
    address, number = needs.listen
    try:
        machine.bind(address, number)
    except OSError as error:
        # The second column of /proc/net/udp ends in the port, the tenth is the inode.
        lines = [line for path in ("udp", "udp6") for line in machine.read(f"/proc/net/{path}", "").splitlines()[1:]]
        rows = [row for line in lines if len(row := line.split()) > 9]
        sockets = {f"socket:[{row[9]}]" for row in rows if row[1].endswith(f":{number:04X}")}
        holder = _holder(machine, sockets)
        if "weberlink.session.daemon" in holder:
            return ok(f"UDP port {number} is held by a running weberlink daemon")
        if sockets:
            by = f" by {holder.split()[0]}" if holder else ""
            return problem(f"UDP port {number} is in use{by}", f"see by whom: sudo ss -lunp 'sport = :{number}'")
        return problem(f"UDP {address}:{number} cannot be listened on: {error.strerror}")
    return ok(f"UDP port {number} is free")


def _holder(machine: Machine, sockets: set[str]) -> str:
    """The command line of the process that has one of these sockets; empty if this user may not see it."""
    for link in (machine.root / "proc").glob("[0-9]*/fd/*"):
        try:
            if str(link.readlink()) in sockets:
                return (link.parents[1] / "cmdline").read_bytes().decode(errors="replace").replace("\0", " ").strip()
        except OSError:
            continue
    return ""


def slave_address(machine: Machine, needs: Needs) -> Finding:  # noqa: PLR0911 - one for each finding
    """Whether the master can reach the slave's host."""
    if needs.slave is None:
        return ok("no slave is called from here")
    name = needs.slave[0]
    set_it = f"in the file: link.slave: ROBOT:PORT (not {name}), or --set link.slave=ROBOT:PORT"
    try:
        address = machine.resolve(name)[0]
    except OSError as error:
        return problem(f"{name} cannot be resolved: {error.strerror}", set_it)
    if is_placeholder(address):
        return problem(f"link.slave is {name}, an address reserved for documentation", set_it)
    try:
        own = machine.route(address)
    except OSError as error:
        return problem(f"no route to {name}: {error.strerror}", f"ip route get {address}")
    if ip_address(address.partition("%")[0]).is_loopback or address == own:
        return ok(f"{name} is this host")
    found = f"{name}: route from {own}"
    if machine.which("ping") is None:
        return ok(f"{found}; not pinged (no ping here)")
    # A slave answers only with the key, so its host is pinged instead.
    if machine.run("ping", "-n", "-c", "1", "-W", "1", address)[0] == 0:
        return ok(f"{found}, answers a ping")
    return unknown(f"{found}; no answer to a ping, perhaps because of a firewall", f"ping -c 3 {address}")


def firewall(machine: Machine, needs: Needs) -> Finding:
    """Which command shows whether the slave's port is open; rules are not read here."""
    if needs.listen is None:
        return ok("nothing listens here, so no port must be open")
    address, number = needs.listen
    if address.startswith("127.") or address in ("localhost", "::1"):
        return ok("the slave listens on loopback, which firewalls rarely filter")
    tool = next(filter(machine.which, FIREWALL_TOOLS), None)
    if tool is None:
        return ok(f"no firewall tool found ({', '.join(FIREWALL_TOOLS)})")
    return unknown(f"UDP port {number} must be open; not checked here", FIREWALL_TOOLS[tool].format(port=number))


def key_file(machine: Machine, needs: Needs) -> Finding:  # noqa: PLR0911 - one for each finding
    """Whether a daemon of this user can read the pre-shared key; its content is never shown."""
    path = needs.key_file
    if path is None:
        if needs.file is None:
            return ok("no file, so no key to check")
        made = "weberlink loopback makes a key for each session"
        return ok(made if needs.encrypted else "the file uses no key: datagrams are not encrypted")
    name, quoted = f"key file {path}", shlex.quote(str(path))
    try:
        status = path.lstat()
    except FileNotFoundError:
        return problem(f"there is no {name}", f"weberlink keygen {quoted}    (or copy the other host's)")
    except OSError as error:
        return problem(f"{name} cannot be read: {error.strerror}", f"ls -ld {quoted}")
    if stat.S_ISLNK(status.st_mode):
        fix = f"in the file, the key file itself: link.key_file: {shlex.quote(str(path.resolve()))}"
        return problem(f"{name} is a symbolic link, which daemons do not follow", fix)
    if status.st_uid != machine.user:
        owner, user = user_name(status.st_uid), user_name(machine.user)
        return problem(f"{name} belongs to {owner}, this is {user}", f"run as {owner}, or: sudo chown {user} {quoted}")
    try:
        keys.load(path)
    except keys.KeyFileError as error:
        found, _, fix = str(error).partition("; ")
        fix = f"chmod 600 {quoted}" if status.st_mode & 0o077 else fix
        return problem(found, fix or f"weberlink keygen {quoted}.new")
    return ok(f"{name}: mode 0600, a key of {8 * keys.KEY_BYTES} bits")
