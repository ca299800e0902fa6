"""A scripted operator: a modelled hand that reaches, turns, slides, taps, presses, circles and rests."""

from collections.abc import Sequence
from itertools import pairwise
from math import radians
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from weberlink.geometry.vector import ZERO, Vector, distance, norm, scale
from weberlink.master.devices.hand_device import CircularLeg, HandDevice, Leg, LegSequence, StraightLeg
from weberlink.master.devices.hand_options import HandDeviceOptions
from weberlink.options import Options

Duration = Annotated[float, Field(gt=0.0, le=3600.0)]

WAY_BACK_S = 1.0


def half_turn_at_most(vector_deg: Vector) -> Vector:
    if norm(vector_deg) > 180.0:
        raise ValueError(f"expected at most half a turn (180 degrees), got {norm(vector_deg):g}")
    return vector_deg


Turn = Annotated[
    Vector,
    AfterValidator(half_turn_at_most),
    Field(description="orientation to have at the end, from that of the device: axis x angle [deg]; needs a wrist"),
]


class ScriptStep(Options):
    """One motion of the script; it begins where the one before left the hand."""

    def legs(self, start: Vector) -> list[Leg]:
        raise NotImplementedError

    @property
    def turn(self) -> Vector | None:
        """Rotation vector at the end [rad]; None for that of the beginning."""
        turn_deg: Vector | None = getattr(self, "turn_deg", None)
        return None if turn_deg is None else scale(turn_deg, radians(1.0))


class ReachStep(ScriptStep):
    """To a point by minimum jerk; turning on the way, axis and angle changing evenly together."""

    motion: Literal["reach"]
    to_m: Vector
    turn_deg: Turn | None = None
    duration_s: Duration = 1.0

    def legs(self, start: Vector) -> list[Leg]:
        return [StraightLeg(start, self.to_m, self.duration_s)]


class SlideStep(ScriptStep):
    """Along points, pressed below them by a depth; every second pass goes back the same way."""

    motion: Literal["slide"]
    points_m: tuple[Vector, ...] = Field(min_length=2, description="on the surface")
    depth_m: float = Field(default=0.015, ge=0.0, le=1.0, description="how far below the surface the hand means to be")
    duration_s: Duration = Field(default=1.5, description="from each point to the next")
    passes: int = Field(default=1, ge=1, le=1000)
    approach_s: Duration = Field(default=0.8, description="to the first point")

    def legs(self, start: Vector) -> list[Leg]:
        points = [below(point, self.depth_m) for point in self.points_m]
        legs: list[Leg] = [StraightLeg(start, points[0], self.approach_s)]
        for number in range(self.passes):
            way = points if number % 2 == 0 else points[::-1]
            legs += [StraightLeg(a, b, self.duration_s) for a, b in pairwise(way)]
        return legs


class CircleStep(ScriptStep):
    """Around a point in a horizontal plane, pressed below it by a depth."""

    motion: Literal["circle"]
    center_m: Vector = Field(description="on the surface")
    radius_m: float = Field(gt=0.0, le=1.0)
    depth_m: float = Field(default=0.015, ge=0.0, le=1.0)
    turns: float = Field(default=1.0, ge=-1e3, le=1e3, description="negative for clockwise")
    duration_s: Duration = 3.0
    approach_s: Duration = Field(default=0.8, description="to where the circle begins, on the side of +x")

    def legs(self, start: Vector) -> list[Leg]:
        circle = CircularLeg(below(self.center_m, self.depth_m), self.radius_m, self.turns, self.duration_s)
        return [StraightLeg(start, circle.at(0.0), self.approach_s), circle]


class TapStep(ScriptStep):
    """Up and down over a point, a number of times at a frequency."""

    motion: Literal["tap"]
    at_m: Vector = Field(description="on the surface")
    height_m: float = Field(default=0.01, gt=0.0, le=1.0, description="above it between taps")
    depth_m: float = Field(default=0.015, ge=0.0, le=1.0, description="below it in a tap")
    frequency_hz: float = Field(default=2.0, gt=0.0, le=20.0)
    count: int = Field(default=4, ge=1, le=10_000)
    approach_s: Duration = 0.8

    def legs(self, start: Vector) -> list[Leg]:
        up, down = below(self.at_m, -self.height_m), below(self.at_m, self.depth_m)
        half = 0.5 / self.frequency_hz
        tap = [StraightLeg(up, down, half), StraightLeg(down, up, half)]
        return [StraightLeg(start, up, self.approach_s), *tap * self.count]


class PressStep(ScriptStep):
    """Onto a point, into it to a depth, hold, and release to a height."""

    motion: Literal["press"]
    at_m: Vector = Field(description="on the surface")
    depth_m: float = Field(default=0.02, gt=0.0, le=1.0)
    hold_s: Duration = 1.0
    height_m: float = Field(default=0.01, ge=0.0, le=1.0)
    duration_s: Duration = Field(default=0.6, description="to go in, and again to come out")
    approach_s: Duration = 0.8

    def legs(self, start: Vector) -> list[Leg]:
        up, down = below(self.at_m, -self.height_m), below(self.at_m, self.depth_m)
        ways = ((start, up, self.approach_s), (up, down, self.duration_s), (down, down, self.hold_s))
        return [StraightLeg(*way) for way in (*ways, (down, up, self.duration_s))]


class RestStep(ScriptStep):
    """Stays where it is."""

    motion: Literal["rest"]
    duration_s: Duration = 1.0

    def legs(self, start: Vector) -> list[Leg]:
        return [StraightLeg(start, start, self.duration_s)]


class TurnStep(ScriptStep):
    """Turns where it is."""

    motion: Literal["turn"]
    turn_deg: Turn
    duration_s: Duration = 1.0

    def legs(self, start: Vector) -> list[Leg]:
        return [StraightLeg(start, start, self.duration_s)]


Script = Annotated[
    ReachStep | SlideStep | CircleStep | TapStep | PressStep | RestStep | TurnStep, Field(discriminator="motion")
]

DEFAULT_SCRIPT: tuple[Script, ...] = (
    SlideStep(motion="slide", points_m=((-0.03, -0.02, 0.0), (0.03, 0.02, 0.0)), passes=2),
    ReachStep(motion="reach", to_m=(-0.03, -0.02, 0.02), duration_s=0.6),
    TapStep(motion="tap", at_m=(0.0, 0.0, 0.0)),
    PressStep(motion="press", at_m=(0.01, -0.01, 0.0)),
    CircleStep(motion="circle", center_m=(0.0, 0.0, 0.0), radius_m=0.025),
    ReachStep(motion="reach", to_m=(0.0, 0.0, 0.03)),
    RestStep(motion="rest", duration_s=0.5),
)


class OperatorOptions(HandDeviceOptions):
    """Options of `operator`. The default script explores a surface at z = 0 within +-6 cm, coming from 3 cm above."""

    script: tuple[Script, ...] = Field(default=DEFAULT_SCRIPT, min_length=1)
    repeat: bool = Field(default=True, description="begin again at the end; otherwise the reading says `ended`")

    @model_validator(mode="after")
    def check_script(self) -> Self:
        position = self.home_m
        for number, step in enumerate(self.script):
            legs = step.legs(position)
            for leg in legs:
                if any(max(map(abs, leg.at(leg.duration * i / 16.0))) > self.workspace_m for i in range(17)):
                    raise ValueError(f"script.{number}: expected motion within the workspace of +-{self.workspace_m} m")
            position = legs[-1].end
            if self.wrist is None and step.turn is not None:
                raise ValueError(f"script.{number}.turn_deg: only a hand with a wrist turns; add `wrist: {{}}`")
        return self


class OperatorDevice(HandDevice):
    """A hand that follows the script."""

    SCRIPTED: ClassVar[bool] = True
    Options: ClassVar[type[OperatorOptions]] = OperatorOptions

    def __init__(self, options: OperatorOptions, tick_period: float) -> None:
        moved, turned = motion_of(options.script, options.home_m, options.repeat)
        super().__init__("operator", options, moved.at, tick_period, lambda time: turned.at(time)[0])


def motion_of(script: Sequence[Script], home: Vector, repeat: bool) -> tuple[LegSequence, LegSequence]:
    """All legs of the script from `home` on, and the rotation vectors [rad] beside them, from level on.

    A repeated script returns there smoothly.
    """
    moves: list[Leg] = []
    turns: list[Leg] = []
    position, turn = home, ZERO
    for step in script:
        legs = step.legs(position)
        moves += legs
        after = turn if step.turn is None else step.turn
        turns.append(StraightLeg(turn, after, sum(leg.duration for leg in legs)))
        position, turn = legs[-1].end, after
    if repeat and (distance(position, home) > 0.0 or turn != ZERO):
        moves.append(StraightLeg(position, home, WAY_BACK_S))
        turns.append(StraightLeg(turn, ZERO, WAY_BACK_S))
    return LegSequence(moves, repeat), LegSequence(turns, repeat)


def below(point: Vector, depth: float) -> Vector:
    return (point[0], point[1], point[2] - depth)
