"""Builds both sides from a configuration: the parts of a hand or of an arm, and what is around them."""

from collections.abc import Callable
from typing import Any

from weberlink.config import Configuration, System
from weberlink.protocol import Role
from weberlink.protocol.events import Address
from weberlink.protocol.liveness import HORIZON_SHARE
from weberlink.protocol.security import Security
from weberlink.realtime.stall import Watchdog
from weberlink.session.composition.channels import playout_ticks, streams
from weberlink.session.composition.link import ANONYMOUS, Entropy, Identity, Parts, Stopwatch, build_endpoint
from weberlink.session.side import Side


def build_master(
    configuration: Configuration,
    *,
    security: Security,
    entropy: Entropy,
    epoch: float,
    stopwatch: Stopwatch,
    peer: Address,
    identity: Identity = ANONYMOUS,
) -> Side:
    """The operator's side, not yet open; raises ConfigurationError if the device cannot do what the file asks."""
    system = configuration.system
    if system.codec.joints is None:
        from weberlink.session.composition.master import build_hand as build  # noqa: PLC0415 - what the file names
    else:
        from weberlink.session.composition.arms import build_leading as build  # noqa: PLC0415 - likewise
    forward, backward = streams(system)
    endpoint = build_endpoint(system, Role.INITIATOR, security, entropy, epoch, forward, backward, peer, identity)
    return _side(system, build(configuration, endpoint), endpoint, stopwatch, system.master.limits.device_ms)


def build_slave(
    configuration: Configuration,
    *,
    security: Security,
    entropy: Entropy,
    epoch: float,
    stopwatch: Stopwatch,
    identity: Identity = ANONYMOUS,
    live: bool = False,
) -> Side:
    """The teleoperator's side, not yet open.

    Args:
        live: whether a simulated robot publishes its pose and measures its steps; not in virtual time.

    Raises:
        ConfigurationError: the robot or the scene cannot be made as the file asks.
    """
    system = configuration.system
    forward, backward = streams(system)
    endpoint = build_endpoint(system, Role.RESPONDER, security, entropy, epoch, backward, forward, None, identity)
    if system.codec.joints is None:
        from weberlink.session.composition.slave import build_led  # noqa: PLC0415 - what the file names

        # Not in virtual time, whose results must not depend on the machine.
        parts = build_led(configuration, endpoint, stopwatch if live else None)
    else:
        from weberlink.session.composition.arms import build_following  # noqa: PLC0415 - likewise

        parts = build_following(configuration)
    return _side(system, parts, endpoint, stopwatch, system.slave.limits.robot_ms)


def _side(system: System, parts: Parts, endpoint: Any, stopwatch: Callable[[], float], patience_ms: float) -> Side:
    port, outgoing, incoming, tuning = parts
    return Side(
        port=port,
        outgoing=outgoing,
        incoming=incoming,
        tuning=tuning,
        endpoint=endpoint,
        tick_period=system.tick_period,
        horizon=HORIZON_SHARE * system.link.silence_ms * 1e-3,
        watchdog=Watchdog(patience_ms * 1e-3),
        stopwatch=stopwatch,
        playout=playout_ticks(system),
    )
