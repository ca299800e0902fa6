"""What both sides build alike from a configuration: agreement, security, endpoint, control, tuning."""

import os
from collections.abc import Callable
from functools import wraps
from getpass import getuser
from pathlib import Path
from secrets import token_bytes
from socket import gethostname
from time import perf_counter, time_ns
from typing import Any, NamedTuple, TypeVar, cast

from weberlink.codec import Decoder, Encoder
from weberlink.codec.choice import CHOICES
from weberlink.config import MASTER, SLAVE, Configuration, ConfigurationError, System
from weberlink.config.finders import PathFinder, finder_of
from weberlink.config.model import split_address
from weberlink.control.contract import SchemeParameters
from weberlink.control.table import SCHEMES
from weberlink.protocol import Role
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import Address
from weberlink.protocol.keys import KEY_BYTES, LONGEST_NAME, HeldKey, KeyFileError, Right, load
from weberlink.protocol.local_end import LocalEnd
from weberlink.protocol.security import Checksum, Security
from weberlink.registry import check_contract, fault_of
from weberlink.session.composition.channels import account, felt_deadbands, longest_round_trip, signal_delay, streams
from weberlink.session.tuning import LiveSettings, Tuning

Entropy = Callable[[int], bytes]


class Context(NamedTuple):
    """What an end is given besides its file."""

    security: Security  # suite, with the key
    entropy: Entropy  # gives random bytes
    epoch: float  # time of tick 0 [s]
    # A clock [s] for the time spent in the codec, and in the steps of a simulated robot, which then publishes its pose;
    # None in virtual time, where nothing depends on the host.
    stopwatch: Callable[[], float] | None = None
    peer: Address | None = None  # address of the slave; None at its own end
    name: str = ""  # where the file sets none; "" for that of the role
    expects: str = ""  # name of the only peer, where the file sets none; "" for any
    take_over: bool = False  # whether a master replaces another one that the slave serves
    asks: Right = Right.DRIVE  # what a caller wants
    stamp: Callable[[float], int] | None = None  # wall clock [ns] at `now` [s]; None to count `now`


F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")


def with_file_name(build: F) -> F:
    """A builder whose errors have the name of the file in front, once."""

    @wraps(build)
    def named(configuration: Configuration, *args: Any, **kwargs: Any) -> Any:
        try:
            return build(configuration, *args, **kwargs)
        except ConfigurationError as error:
            where = f"{configuration.path}: "
            raise ConfigurationError(where + str(error).removeprefix(where)) from None

    return cast(F, named)


def agreement(system: System) -> dict[str, object]:
    """What both ends must hold alike, by the path of the field; without parts of the codec that are not used."""
    codec = system.codec
    unused = {name for name in ("rotation", "joints", "gripper") if getattr(codec, name) is None}
    if codec.joints is not None:
        unused |= {"force", "position"}
    return {
        "rate_hz": system.rate_hz,
        "axes": system.axes,
        "link.silence_ms": system.link.silence_ms,
        **_flat(system.control.model_dump(mode="json"), "control."),
        **_flat(codec.model_dump(mode="json", exclude=unused), "codec."),
    }


def _flat(tree: dict[str, Any], prefix: str) -> dict[str, object]:
    leaves: dict[str, object] = {}
    for key, value in tree.items():
        leaves |= _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return leaves


@with_file_name
def build_security(configuration: Configuration) -> Security:
    """The security suite that the file asks for; only that one is imported. With a key, no core is dumped any more.
    Raises ConfigurationError if the key file cannot be used, or the peer is not known."""
    link = configuration.system.link
    parts = {MASTER: configuration.device, SLAVE: configuration.robot}
    loaded = [side for side, part in parts.items() if part is not None]
    if len(loaded) == 1 and (finder := finder_of(configuration, *loaded)) is not None:  # a process runs one side
        return finder.security
    if link.security == "none":
        return Checksum()
    from weberlink.protocol.psk import Keyring, PresharedKey  # noqa: PLC0415
    from weberlink.realtime.process import forbid_core_dumps  # noqa: PLC0415

    forbid_core_dumps()
    if link.key_file is None:  # security: session before the run, or both sides in virtual time
        return PresharedKey(token_bytes(KEY_BYTES))
    if loaded == [SLAVE]:
        return Keyring(held_keys(link.key_file))
    return PresharedKey(own_key(link.key_file).key)


def held_keys(path: Path) -> tuple[HeldKey, ...]:
    """Those of a key file; ConfigurationError if it cannot be used."""
    try:
        return load(path)
    except KeyFileError as error:
        raise ConfigurationError(f"link.key_file: {error}") from None


def own_key(path: Path) -> HeldKey:
    """That of a caller; ConfigurationError as of `held_keys`, or if there are several."""
    key, *others = held_keys(path)
    if others:
        raise ConfigurationError(f"link.key_file: {path} holds several keys, which is for the robot's end")
    return key


def acquaintance(configuration: Configuration, side: str, finder: PathFinder | None) -> tuple[Security, str, str]:
    """Suite, own name and the name of the only peer ("" for any) of a process that runs one side, where the file sets
    no names; ConfigurationError as of `build_security`."""
    if finder is not None:
        return finder.security, finder.own, finder.expects
    link = configuration.system.link
    named = own_key(link.key_file).name if side == MASTER and link.security == "psk" and link.key_file else ""
    if named and link.names.master not in (None, named):
        raise ConfigurationError(
            f"link.names.master: the key is that of {named!r}; leave the name out, or take its own"
        )
    return build_security(configuration), named or default_name(side, link.listen), ""


def default_name(side: str, listen: str) -> str:
    """The name of a side where the file gives none."""
    host = gethostname()
    if side == SLAVE:
        name = f"{host}:{split_address(listen)[1]}"
    else:
        try:
            name = f"{getuser()}@{host}"
        except (KeyError, OSError):  # a user id without a name, as in containers
            name = f"{os.getuid()}@{host}"
    return "".join(letter for letter in name if letter.isprintable())[-LONGEST_NAME:]


def live_context(
    configuration: Configuration, side: str, finder: PathFinder | None, epoch: float, **asked: Any
) -> Context:
    """That of a process that runs one side, or asks the slave: `asked` are `take_over` and `asks`. ConfigurationError
    as of `build_security`."""
    security, name, expects = acquaintance(configuration, side, finder)
    peer = None
    if side == MASTER:
        from weberlink.protocol.aio.udp import peer_address  # noqa: PLC0415 - not in virtual time

        found, link = configuration.finds_path, configuration.system.link
        peer = peer_address(expects) if found else split_address(link.slave)
    made = Context(security, os.urandom, epoch, perf_counter, peer, name, expects, stamp=lambda _now: time_ns())
    return made._replace(**asked)


def build_endpoint(system: System, side: str, context: Context) -> Endpoint:
    names = system.link.names
    (outgoing, incoming), role, own, other = streams(system), Role.INITIATOR, names.master, names.slave
    if side == SLAVE:
        outgoing, incoming, role, own, other = incoming, outgoing, Role.RESPONDER, other, own
    end = LocalEnd(
        role=role,
        agreement=agreement(system),
        outgoing=[channel.forms for channel in outgoing],
        incoming=[channel.forms for channel in incoming],
        security=context.security,
        entropy=context.entropy,
        epoch=context.epoch,
        tick_period=system.tick_period,
        silence=system.link.silence_ms * 1e-3,
        longest_round_trip=system.link.longest_round_trip_ms * 1e-3,
        carries_credit=SCHEMES[system.control.scheme].carries_credit and system.codec.joints is None,
        name=own or context.name,
        expects=other or context.expects,
        take_over=context.take_over,
        stamp=context.stamp,
        asks=context.asks,
    )
    return Endpoint(end, context.peer)


def build_control(system: System, build: Callable[[str, SchemeParameters], T], coupling: float) -> T:
    """One end of the control scheme; `coupling` is the stiffness of the robot towards its command [N/m]. Raises
    ConfigurationError if the scheme is of another distribution and broken."""
    settings = SchemeParameters(
        tick_period=system.tick_period,
        coupling=coupling,
        account=account(system.control, system.master.mapping),
        delay=signal_delay(system),
        longest=longest_round_trip(system),
    )
    made: T = build_driver("control.scheme", build, system.control.scheme, settings)
    return made


def build_driver(where: str, driver: Any, *arguments: Any, contract: type | None = None) -> Any:
    """A driver from its options; what it cannot accept is an error of its place in the file.

    Args:
        contract: a protocol that its object must satisfy; the driver may be of another distribution.

    Raises:
        ConfigurationError: it takes other arguments or refuses them, lacks a method, or raises anything else.
    """
    try:
        made = driver(*arguments)
        if contract is not None:
            check_contract(where, made, contract)
    except ValueError as error:
        raise ConfigurationError(f"{where}: {str(error).removeprefix(f'{where}: ')}") from None
    except Exception as error:
        fault = fault_of(error)
        if fault is not None and fault.is_foreign:
            raise ConfigurationError(f"{where}: {fault.text}") from error
        if driver.__module__.startswith("weberlink."):
            raise
        raise ConfigurationError(f"{where}: {driver.__module__}:{driver.__qualname__}: {error}") from error
    return made


def check_axes(where: str, axes: str, system: System) -> None:
    """See that a device or robot moves on every axis that is sent; raises ConfigurationError naming those that it
    lacks."""
    missing = [axis for axis in system.axes if axis not in axes]
    if missing:
        raise ConfigurationError(f"axes: {where} has no axis {', '.join(missing)}; it has {axes}")


def build_tuning(system: System, coder: Encoder | Decoder, hand: Any = None) -> Tuning:
    """The tuning of a side, which encodes or decodes the force, or the torques of joints; `hand`: the position of a
    hand, whose deadband follows that of its force."""
    force, joints = system.codec.force, system.codec.joints
    bank = force.bank if joints is None and force.predictor in CHOICES else ()

    def retune(settings: LiveSettings, peer_tick: float) -> None:
        deadband, *more = felt_deadbands(system, settings.weber)
        if hand is not None:
            hand.weber = settings.weber
        if isinstance(coder, Decoder):
            coder.retune(deadband, peer_tick)
        else:
            selectors = [bank.index(settings.predictor)] if settings.predictor in bank else range(len(bank) or 1)
            coder.retune(deadband, selectors, more)

    felt = force if joints is None else joints.torque
    settings = LiveSettings(felt.weber, felt.predictor)
    return Tuning(settings, live_choices(system), retune, is_master=isinstance(coder, Decoder))


def live_choices(system: System) -> dict[str, tuple[str, ...]]:
    """What may be changed in a session of this file, and to which names; k to any number from 0 to 1.

    The bank that was agreed holds every predictor that may be chosen, so an update says by its selector what it needs.
    """
    if not system.control.live_changes:
        return {}
    force = system.codec.force
    if system.codec.joints is None and force.predictor in CHOICES and len(force.bank) > 1:
        return {"weber": (), "predictor": (*force.bank, force.predictor)}
    return {"weber": ()}
