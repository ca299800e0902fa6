"""Builds a side from a configuration: the parts of a hand or of an arm, and what is around them."""

from weberlink.config import MASTER, Configuration
from weberlink.protocol.liveness import HORIZON_SHARE
from weberlink.session.composition.channels import playout_ticks
from weberlink.session.composition.link import Context, build_endpoint, with_file_name
from weberlink.session.side import Parts, Side


@with_file_name
def build_side(configuration: Configuration, side: str, context: Context) -> Side:
    """The operator's or the teleoperator's side, not yet open; raises ConfigurationError if device, robot or scene
    cannot be made as the file asks."""
    system = configuration.system
    endpoint = build_endpoint(system, side, context)
    # What the file does not name is not imported.
    parts: Parts
    if system.codec.joints is not None:
        from weberlink.session.composition import arms  # noqa: PLC0415

        parts = (arms.build_leading if side == MASTER else arms.build_following)(configuration, endpoint)
    elif side == MASTER:
        from weberlink.session.composition.master import build_hand  # noqa: PLC0415

        parts = build_hand(configuration, endpoint)
    else:
        from weberlink.session.composition.slave import build_led  # noqa: PLC0415

        parts = build_led(configuration, endpoint, context.stopwatch)
    patience_ms = system.master.limits.device_ms if side == MASTER else system.slave.limits.robot_ms
    return Side(
        parts,
        endpoint,
        tick_period=system.tick_period,
        horizon=HORIZON_SHARE * system.link.silence_ms * 1e-3,
        patience=patience_ms * 1e-3,
        stopwatch=context.stopwatch or float,
        playout=playout_ticks(system),
    )
