"""A recorded hand: the intended position follows a trace, and the hand still yields to forces."""

from math import isfinite
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field

from weberlink.geometry.vector import Vector
from weberlink.master.devices.hand_device import HandDevice, LegSequence, RecordedLeg, StraightLeg
from weberlink.master.devices.hand_options import HandDeviceOptions
from weberlink.master.trace import Trace, read_motion


def signed_axes(text: str) -> str:
    signs, letters = text[::2], text[1::2]
    if len(text) != 6 or set(signs) - {"+", "-"} or sorted(letters) != ["x", "y", "z"]:
        raise ValueError('expected three signed axes, each once, such as "+x+y+z" or "+x-z+y"')
    return text


class ReplayOptions(HandDeviceOptions):
    """Options of `replay`."""

    trace: Path = Field(description="CSV file with the header t,px,py,pz,fx,fy,fz, or a recording (MCAP)")
    axes: Annotated[str, AfterValidator(signed_axes)] = Field(
        default="+x+y+z", description="which signed axis of the trace becomes x, y and z here"
    )
    scale: float = Field(default=1.0, ge=1e-3, le=1e3, description="of the motion about its anchor")
    center_m: Vector | None = Field(default=None, description="where the anchor is moved to; not given: it stays")
    anchor: Literal["mean", "first"] = Field(
        default="mean", description="the trace's mean position, or its first sample"
    )
    approach_s: float = Field(
        default=1.0, ge=1e-3, le=3600.0, description="from home to the first sample, and back on repeat"
    )
    repeat: bool = Field(default=False, description="begin again at the end; otherwise the reading says `ended`")


class ReplayDevice(HandDevice):
    """A hand that follows the trace."""

    SCRIPTED: ClassVar[bool] = True
    Options: ClassVar[type[ReplayOptions]] = ReplayOptions

    def __init__(self, options: ReplayOptions, tick_period: float) -> None:
        """Raises TraceError (a ValueError) if the file is not a trace."""
        leg = placed(read_motion(options.trace), options)
        approach = StraightLeg(options.home_m, leg.start, options.approach_s)
        back = [StraightLeg(leg.end, leg.start, options.approach_s)] if options.repeat else []
        rounds = LegSequence([leg, *back], options.repeat)

        def intention(time: float) -> tuple[Vector, bool]:
            time -= approach.duration
            return rounds.at(time) if time >= 0.0 else (approach.at(approach.duration + time), False)

        super().__init__("replay", options, intention, tick_period)


def placed(trace: Trace, options: ReplayOptions) -> RecordedLeg:
    """The trace in the frame and at the place that the options ask for."""
    order = ["xyz".index(letter) for letter in options.axes[1::2]]
    signs = [1.0 if sign == "+" else -1.0 for sign in options.axes[::2]]
    position = trace.position_m[:, order] * signs
    anchor = position.mean(axis=0) if options.anchor == "mean" else position[0]
    moved = (position - anchor) * options.scale + (anchor if options.center_m is None else options.center_m)
    edge = options.workspace_m
    farthest = float(abs(moved).max())
    if not (isfinite(farthest) and farthest <= edge):
        raise ValueError(
            f"trace: {options.trace} reaches {farthest:.4g} m from the origin, beyond the workspace of +-{edge} m; "
            "expected a smaller scale, another center_m, or a larger workspace_m"
        )
    times: list[float] = (trace.time_s - trace.time_s[0]).tolist()
    return RecordedLeg(times, [(x, y, z) for x, y, z in moved.tolist()])
