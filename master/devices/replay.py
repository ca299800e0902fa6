"""A recorded hand: the intended position follows a trace, and the hand still yields to forces."""

from math import isfinite
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field

from weberlink.geometry.vector import Vector, interpolate
from weberlink.master.devices.hand_device import HandDevice
from weberlink.master.devices.hand_options import HandDeviceOptions
from weberlink.master.devices.motion import StraightLeg
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
        samples = placed(read_motion(options.trace), options)
        super().__init__("replay", options, TraceFollower(samples, options).at, tick_period)


Samples = tuple[list[float], list[Vector]]


def placed(trace: Trace, options: ReplayOptions) -> Samples:
    """Times from 0 [s] and positions [m] of the trace, in the frame and at the place that the options ask for."""
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
    return times, [(x, y, z) for x, y, z in moved.tolist()]


class TraceFollower:
    """The trace as an intention: a smooth approach from home, then linear between samples.

    Asked with times that never go back, so it remembers which sample it has reached.
    """

    def __init__(self, samples: Samples, options: ReplayOptions) -> None:
        self._times, self._positions = samples
        self._approach = StraightLeg(options.home_m, self._positions[0], options.approach_s)
        self._return = StraightLeg(self._positions[-1], self._positions[0], options.approach_s)
        self._repeat = options.repeat
        self._round = 0.0
        self._index = 0

    def at(self, time: float) -> tuple[Vector, bool]:
        """Position [m] at `time` [s] from the start, and whether the trace is over."""
        time -= self._approach.duration
        if time < 0.0:
            self._round, self._index = 0.0, 0
            return self._approach.at(1.0 + time / self._approach.duration), False
        length = self._times[-1]
        if self._repeat:
            while time - self._round >= length + self._return.duration:
                self._round += length + self._return.duration
                self._index = 0
        time -= self._round
        if time >= length:
            if self._repeat:
                return self._return.at((time - length) / self._return.duration), False
            return self._positions[-1], True
        times, index = self._times, self._index
        while times[index + 1] <= time:
            index += 1
        self._index = index
        share = (time - times[index]) / (times[index + 1] - times[index])
        return interpolate(self._positions[index], self._positions[index + 1], share), False
