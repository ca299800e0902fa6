"""A channel: all that the two ends of a coded signal must agree on. Both build it from the same configuration."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import inf

from weberlink.codec.choice import CHOICES, HYBRID
from weberlink.codec.deadband import Deadband, ForceDeadband, PerAxisDeadband, PositionDeadband
from weberlink.codec.predictors import PREDICTORS, FitLimits, Predictor, suits
from weberlink.codec.rate import UpdateRate
from weberlink.codec.sample import Quantizer, Sample, SampleGrid
from weberlink.compiled import mypyc_attr
from weberlink.geometry.joints import PART, Joints, parts
from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.update import MAX_SELECTOR, UpdateForm

ROUNDING = 0.5 * (1.0 + 1e-9)  # Largest rounding error of the wire [steps], with that of the arithmetic


@mypyc_attr(allow_interpreted_subclasses=True)
@dataclass(frozen=True)
class Channel:
    """One coded stream: a vector of the hand, or the joints of an arm, three to a part.

    One decision is made for a whole stream: where one part leaves its deadband, all are sent. So an update restores
    the whole decoder, and the joints of an arm are always of the same moment.

    The receiver needs neither `choice` nor `rate`.

    Raises:
        ValueError: for a number out of range; for an unknown, repeated or missing predictor, or one that does not suit.
    """

    bank: tuple[str, ...]  # names of the predictors; a selector is an index in it
    deadband: Deadband  # the bound on an unsent error
    value_quantizer: Quantizer  # the wire grid of the coded value
    position_quantizer: Quantizer | None = None  # that of the position of a force; None if the value is the position
    rest: Vector | None = None  # value before the first update; None if unknown: the first sample is always sent
    fit_limits: FitLimits = field(default_factory=FitLimits)  # the range in which a fitted contact is accepted
    choice: str = HYBRID  # name in `CHOICES` of how the sender chooses among the bank, and makes models of parameters
    smoothing: int = 0  # length of the ramp over which an update changes the value [ticks], >= 0; 0 for a step
    rate: UpdateRate | None = None  # largest rate of updates; None for no limit
    every_position: bool = False  # whether every update carries the position: others than predictors read it
    tick_period: float = 1e-3  # time between ticks [s], > 0
    lookahead: int = 0  # ticks by which the encoder looks ahead and the decoder displays late, >= 0
    joints: int = 0  # number of values, where they are those of an arm's joints; 0 for a vector
    more: tuple["Channel", ...] = ()  # further parts of an arm, of other axes and thresholds; one unit for all errors

    def __post_init__(self) -> None:
        for name, ticks in (("lookahead", self.lookahead), ("smoothing", self.smoothing)):
            if ticks < 0:
                raise ValueError(f"{name} must be >= 0 ticks, not {ticks!r}")
        if len(self.bank) > MAX_SELECTOR + 1:
            raise ValueError(f"bank must name at most {MAX_SELECTOR + 1} predictors, not {len(self.bank)}")
        unknown = [name for name in self.bank if name not in PREDICTORS]
        if unknown or not self.bank or len(set(self.bank)) != len(self.bank):
            raise ValueError(f"bank must name some of {', '.join(PREDICTORS)}, each once, not {self.bank!r}")
        if not 0.0 < self.tick_period < inf:
            raise ValueError(f"tick_period must be positive and finite, not {self.tick_period!r}")
        signal = "joints" if self.joints else "position" if self.position_quantizer is None else "force"
        misfits = [name for name in self.bank if not suits(name, signal)]
        if misfits:
            raise ValueError(f"{', '.join(misfits)}: not for {signal}; use a predictor such as zoh or linear")
        misfits = unfit_for(self.choice, self.bank)
        if misfits:
            raise ValueError(f"{', '.join(misfits)}: not for {self.choice}, which does not make their models")

    @property
    def predictors(self) -> tuple[Predictor, ...]:
        return tuple(PREDICTORS[name] for name in self.bank)

    @property
    def forms(self) -> tuple[UpdateForm, ...]:
        """What updates carry, by selector.

        The position goes with a predictor that reads it. With smoothing it goes with all, if any predictor reads it:
        the ramp begins at the value of the model before, whichever that is.
        """
        predictors, grid = self.predictors, self.grid
        if self.joints:
            sizes = (grid.value.size, *[part.value_quantizer.size for part in self.more])
            return tuple(UpdateForm(sizes, sizes) for _ in predictors)
        everywhere = self.every_position or (self.smoothing > 0 and any(each.geometric for each in predictors))
        return tuple(
            UpdateForm(grid.groups if everywhere else each.groups(grid), None if each.estimated else each.groups(grid))
            for each in predictors
        )

    @property  # not a cached_property: its entry in __dict__ would slow down the reading of every other attribute
    def grid(self) -> SampleGrid:
        return SampleGrid(self.value_quantizer, self.position_quantizer, self.tick_period)

    def displayable(self, predicted: Vector, newest: Sample) -> Vector:
        """A prediction saturated as a measured value is; the newest sample if the prediction is not finite."""
        return self.value_quantizer.confine(predicted) if is_finite(predicted) else newest.value

    def place(self, position: Vector) -> Vector:
        """The position at which a model is evaluated [m]: saturated as the position of a sample is."""
        return position if self.position_quantizer is None else self.position_quantizer.confine(position)


def unfit_for(choice: str, bank: Iterable[str]) -> list[str]:
    """Those of a bank that an entry of `CHOICES` does not take; ValueError for one that is unknown."""
    kind = CHOICES.load(choice)
    return [name for name in bank if not kind.takes(PREDICTORS[name])]


def joint_channel(
    *,
    bounds: Joints,
    step: float,
    predictor: str = "linear",
    weber: float = 0.0,
    tick_period: float = 1e-3,
    rest: Joints | None = None,
    rate: UpdateRate | None = None,
) -> Channel:
    """Make the channel of a vector of joint values.

    Args:
        bounds: absolute threshold of each axis, > 0: the deadband of an angle [rad], the floor of a torque [N m].
        step: wire step, > 0 [rad or N m].
        predictor: a name of `PREDICTORS` that reads no position and sends no parameters.
        weber: Weber factor of the value on its own axis, >= 0; 0 for angles.
        tick_period, rest, rate: as of `Channel`; `rest` has a value for each axis.

    Raises:
        ValueError: as `Channel`, or for a number out of its range.
    """
    if rest is not None and len(rest) != len(bounds):
        raise ValueError(f"rest has {len(rest)} axes, bounds {len(bounds)}")
    more: tuple[Channel, ...] = ()
    # The last part first: the first one holds the others. An axis that a part does not have is never beyond its bound.
    for start in reversed(range(0, len(bounds), PART)):
        width = min(PART, len(bounds) - start)
        x, y, z = (*bounds[start:], inf, inf)[:PART]
        made = Channel(
            (predictor,),
            PerAxisDeadband(weber, (x, y, z), ROUNDING * step),
            Quantizer(step, "xyz"[:width]),
            rest=None if rest is None else parts(rest)[start // PART],
            rate=rate,
            tick_period=tick_period,
            joints=len(bounds) if start == 0 else width,
            more=more if start == 0 else (),
        )
        more = (made, *more)
    return made


def force_channel(
    *,
    predictor: str = HYBRID,
    bank: Sequence[str] | None = None,
    weber: float = 0.10,
    floor: float = 0.02,
    deadband: Deadband | None = None,
    axes: str = "xyz",
    force_step: float = 1e-3,
    position_step: float = 1e-5,
) -> Channel:
    """Make the backward channel: forces [N], and the commanded positions [m] at which they were measured.

    What else a channel has, `dataclasses.replace` sets.

    Args:
        predictor: a name of `PREDICTORS`, or one of `CHOICES` for a choice among `bank`.
        bank: the predictors to choose among, by default those of the choice; otherwise not read.
        weber: Weber factor k, >= 0.
        floor: absolute threshold [N], >= 0.
        deadband: a deadband of another shape; `weber` and `floor` are not read then.
        axes: the axes that are sent.
        force_step: wire step [N], > 0.
        position_step: wire step [m], > 0.

    Raises:
        ValueError: as `Channel`, or for a number out of range.
    """
    choice, names = chosen(predictor, bank, "force")
    return Channel(
        bank=names,
        deadband=deadband if deadband is not None else ForceDeadband(weber, floor),
        value_quantizer=Quantizer(force_step, axes),
        position_quantizer=Quantizer(position_step, axes),
        rest=ZERO,
        choice=choice,
    )


def position_channel(
    *,
    predictor: str = "linear",
    bank: Sequence[str] | None = None,
    weber: float = 0.10,
    bound: float = 2e-4,
    axes: str = "xyz",
    position_step: float = 1e-5,
) -> Channel:
    """Make the forward channel: commanded positions [m].

    Arguments and errors as for `force_channel`. The deadband is `bound` [m] at rest, and wider by `weber` times the
    distance moved in a tick.
    """
    choice, names = chosen(predictor, bank, "position")
    return Channel(
        bank=names,
        deadband=PositionDeadband(weber, bound),
        value_quantizer=Quantizer(position_step, axes),
        choice=choice,
    )


def chosen(predictor: str, bank: Sequence[str] | None, signal: str) -> tuple[str, tuple[str, ...]]:
    """Choice and bank of a name in `PREDICTORS` or `CHOICES`; ValueError if it is in neither."""
    if predictor in CHOICES or predictor in CHOICES.absent():
        choice = CHOICES.load(predictor)
        return predictor, tuple(choice.bank(signal) if bank is None else bank)
    return PREDICTORS.load(predictor).choice, (predictor,)
