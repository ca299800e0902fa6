"""The account of the energy out of the hand, as the operator's end builds it and as a report checks it."""

from weberlink.control.contract import AccountParameters
from weberlink.system.configuration.model import ControlSettings, MappingSettings


def account(control: ControlSettings, mapping: MappingSettings | None, *, turns: bool = False) -> AccountParameters:
    """What bounds the energy out of the hand, in the robot's frame, where lengths and forces are scaled, but no angles.

    Args:
        control: of both sides.
        mapping: of the hand's frame to the robot's; None where they are one.
        turns: whether it is that of a torque.
    """
    force_scale = 1.0 if mapping is None else mapping.force_scale
    scale = 1.0 if mapping is None or turns else mapping.scale
    energy = scale / force_scale
    return AccountParameters(
        allowance=energy * control.allowance_j,
        refill=energy * control.refill_w,
        damping=control.damping_n_s_m / (scale * force_scale),
        rise=control.rise_n_s / force_scale,
    )
