"""What drivers of hardware share: their options, and the check of signs without which a device has no force."""

from typing import Annotated, Any

from pydantic import Field

from weberlink.master.devices.contract import DeviceSpec
from weberlink.options import Options

Stiffness = Annotated[float, Field(ge=1e-3, le=1e9)]  # of the stiffest wall that a device displays [N/m]
Reply = Annotated[float, Field(ge=1.0, le=100.0, description="how long an answer may take")]  # [ms]


class HardwareOptions(Options):
    """Options of a device that is looked for when it is gone."""

    reconnect_s: float = Field(default=0.0, ge=0.0, le=60.0, description="how long to look for it when it is gone")


class PortOptions(HardwareOptions):
    """Options of a device that has a path here."""

    port: str | None = Field(default=None, description="path of the device; the only one plugged in if not given")


class ForceOptions(Options):
    """The option of a device with force feedback that its driver's `fingerprint` is compared with."""

    signs_checked: Annotated[str, Field(pattern="^[0-9a-f]{8}$")] | None = Field(
        default=None, description="what `weberlink device test` prints once the directions are right; no force without"
    )


def limited_force(asked: float | None, published: float, model: str) -> float:
    """The largest force [N]: as asked, or what is published of the model; raises ValueError for more than that."""
    if asked is not None and asked > published:
        raise ValueError(f"force_n: expected at most {published:g} N for {model}, got {asked:g}")
    return published if asked is None else asked


def force_spec(
    name: str,
    options: ForceOptions,
    signs: str | None,
    *,
    force_n: float,
    torque_n_m: float = 0.0,
    note: str = "",
    reminder: str = "",
    **others: Any,
) -> DeviceSpec:
    """The spec of a device that has force, and torque, only with checked signs; its limits are those with checked ones.

    `signs` is the fingerprint of all settings that turn an axis; None where they do not say which device it is. `note`
    is for a device with force, `reminder` for any.
    """
    armed = signs is not None and options.signs_checked == signs
    if signs is None:
        note = "no force: the file does not say which device it is; set master.device.model"
    elif not armed:
        stale = "" if options.signs_checked is None else " with these settings"
        note = f"no force: signs not checked{stale}; run: weberlink device test {name}"
    return DeviceSpec(
        name=name,
        force_n=force_n if armed else 0.0,
        torque_n_m=torque_n_m if armed else 0.0,
        force_feedback=armed,
        note="; ".join(filter(None, (note, reminder))),
        **others,
    )
