"""Checks of network, key, devices and software."""

import shlex
from collections.abc import Iterator
from ipaddress import ip_address

from weberlink.cli.devices import BROKEN, NO_EXTRA, NOTHING, READY, UNSEEN, DriverStatus
from weberlink.compiled import build
from weberlink.config.model import is_placeholder
from weberlink.installation import all_guests, pip_install
from weberlink.protocol import keys
from weberlink_doctor.host.checks import check
from weberlink_doctor.host.machine import Machine
from weberlink_doctor.report import Finding, Needs, advice, ok, problem, unknown

# --- network and key

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


@check("network", "receive buffer")
def receive_buffer(machine: Machine, needs: Needs) -> Finding:
    """Whether the socket holds all updates of a stall as long as the silence limit, at one update per tick."""
    size, largest = (machine.number(f"/proc/sys/net/core/rmem_{name}") for name in ("default", "max"))
    holds_ms = 1e3 * size / CHARGED_BYTES / needs.rate_hz
    found = f"UDP receive buffer {size} B holds {holds_ms:.0f} ms at one update per tick"
    silence_ms = needs.system.link.silence_ms
    if holds_ms >= silence_ms:
        return ok(f"{found} (limit {largest} B)")
    wanted = int(2e-3 * silence_ms * needs.rate_hz * CHARGED_BYTES)
    return advice(found, f"sudo sysctl -w net.core.rmem_default={wanted}")


@check("network", "port", "in the file: link.listen, with 0.0.0.0 or an address of `ip -brief address`")
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
        holder = machine.command_that_holds(sockets)
        if "weberlink.session.daemon" in holder:
            return ok(f"UDP port {number} is held by a running weberlink daemon")
        if sockets:
            by = f" by {holder.split()[0]}" if holder else ""
            return problem(f"UDP port {number} is in use{by}", f"see by whom: sudo ss -lunp 'sport = :{number}'")
        return problem(f"UDP {address}:{number} cannot be listened on: {error.strerror}")
    return ok(f"UDP port {number} is free")


@check("network", "slave address")
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


@check("network", "firewall")
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


@check("key", "key file")
def key_file(_machine: Machine, needs: Needs) -> Finding:
    """Whether a daemon of this user can read the pre-shared key; its content is never shown."""
    link = needs.system.link
    path = link.key_file
    if path is None or link.security != "psk":
        if needs.file is None:
            return ok("no file, so no key to check")
        made = "weberlink loopback makes a key for each session"
        return ok(made if link.security != "none" else "the file uses no key: datagrams are not encrypted")
    try:
        keys.load(path)
    except keys.KeyFileError as error:
        found, _, fix = str(error).partition("; ")
        quoted = shlex.quote(str(path))
        if found.endswith("does not exist"):
            fix = f"weberlink keygen {quoted}    (or copy the other host's)"
        another = f"ls -ld {quoted}    (another key: weberlink keygen {quoted}.new)"
        return problem(f"key file {found}", fix.removeprefix("run: ") or another)
    return ok(f"key file {path}: mode 0600, a key of {8 * keys.KEY_BYTES} bits")


# --- devices and software


@check("devices", "devices")
def devices(machine: Machine, needs: Needs) -> Iterator[Finding]:
    """State of the drivers that the file names, and of other devices plugged in."""
    others = 0
    for each in machine.drivers():
        if needs.drivers.get(each.side) == each.driver:
            yield _named(each)
        elif each.plugged:
            others += 1
            found = f"{each.driver} at {', '.join(device.path for device in each.plugged)}: {each.state}"
            helps = each.advice and each.state not in (NO_EXTRA, BROKEN)
            yield advice(found, each.advice[0], "device") if helps else ok(found, "device")
    if not others:
        yield ok(f"nothing {'else ' if needs.drivers else ''}plugged in that a driver knows")


def _named(status: DriverStatus) -> Finding:
    """The finding on a driver that the file names."""
    name, check = f"{status.side} {status.driver}", "driver"
    first = next(iter(status.advice), None)
    if status.state == READY:
        name += f" at {status.plugged[0].path}" if status.plugged else f", {status.kind}"
        return advice(name, first, check) if first else ok(f"{name}: ready", check)
    if status.state == UNSEEN:
        return ok(f"{name}: cannot be listed; to try it: weberlink device test {status.driver}", check)
    if status.state == NOTHING:
        fix = "plug it in and switch it on, then: weberlink device list"
        return problem(f"{name}: no such device plugged in", fix, check)
    return problem(f"{name}: {status.state}", first or "weberlink device list", check)


@check("software", "software")
def software(machine: Machine, _needs: Needs) -> Iterator[Finding]:
    python = machine.python()
    name = f"Python {python['number']}"
    if python["is_debug"]:
        yield problem(f"{name} is a debug build, several times slower", "use a release build of Python", "Python")
    elif python["is_dev_mode"]:
        found = f"{name} in development mode, which is slow"
        yield advice(found, "unset PYTHONDEVMODE; run without -X dev", "Python")
    elif python["is_free_threaded"]:
        found = f"{name} is a free-threaded build, which is untested"
        yield advice(found, "use the ordinary build of Python", "Python")
    else:
        yield ok(name, "Python")
    yield ok(f"weberlink: {build(compiled=machine.is_compiled())}", "build")
    number = machine.version("uvloop")
    fix = f"{pip_install()} uvloop"
    yield ok(f"uvloop {number}", "uvloop") if number else problem("uvloop is not installed", fix, "uvloop")
    known = all_guests()
    missing = [name for name in sorted(known) if machine.version(f"weberlink-{name}") is None]
    absent = f"guests not installed: {', '.join(missing)}"
    yield ok(absent if missing else f"all {len(known)} guests are installed", "guests")
