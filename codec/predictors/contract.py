"""What every predictor is: a way from one update to a model that says the value elsewhere.

A model is a pure function of what one update carries. That is what makes the two ends agree after any loss: there is no
other state that could differ. There are two ways: the model is fitted to the newest transmitted samples, at both ends
alike (`Predictor`), or at the sending end to all samples, and its parameters are sent (`Parametric`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from weberlink.codec.parameters import pack, unpack
from weberlink.codec.predictors.hold import Hold
from weberlink.codec.quantizer import Grids
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import Vector, distance, norm


class Wall(Protocol):
    """An elastic wall at rest: its force depends on the position alone, and what it takes to press it in comes back."""

    @property
    def stiffness(self) -> float:
        """[N/m]: half the square of the force by this is the energy stored."""
        ...

    def at(self, tick: float, position: Vector) -> Vector:
        """The force [N] at a position [m]; the tick does not matter."""
        ...


class Model(Protocol):
    """A fitted predictor. Compares equal to another with the same parameters, bit for bit."""

    def at(self, tick: float, position: Vector) -> Vector:
        """Predict.

        Args:
            tick: now, on the sender's tick clock; fractional where the reader's clock does not tick with the sender's.
            position: the commanded position now [m].

        Returns:
            The predicted value in the unit of the samples. May leave every bound or be non-finite for wild inputs; the
            channel confines it.
        """
        ...

    def wall(self) -> Wall | None:
        """The wall that can be rendered in place of this model, as it was at the newest sample; None if it is none."""
        ...


@dataclass(frozen=True, slots=True)
class Trust:
    """The declared range in which a fitted contact is believed; outside it a predictor holds the newest sample.

    Args:
        stiffness: contact stiffness [N/m], lowest and highest, > 0.
        radius: radius of a sphere [m], lowest and highest, > 0.
        least_angle_sine: sine of the angle below which two directions count as one, 0 to 1: those of the two forces
            (1 mN across 1 N is the noise of the wire), and the columns of the sphere's system of equations.
        misfit: largest error of a fit at its own newest sample, as a share of that force, > 0. A least-squares fit of
            two samples that are no sphere misses them: it may put the sample beyond its centre, and push the wrong way.

    Raises:
        ValueError: for a range that is none.
    """

    stiffness: tuple[float, float] = (1.0, 1e6)
    radius: tuple[float, float] = (1e-3, 10.0)
    least_angle_sine: float = 1e-3
    misfit: float = 0.25

    def __post_init__(self) -> None:
        for name, (low, high) in (("stiffness", self.stiffness), ("radius", self.radius)):
            if not 0.0 < low < high:
                raise ValueError(f"{name} must be a rising pair of positive numbers, not [{low!r}, {high!r}]")
        if not 0.0 <= self.least_angle_sine <= 1.0:
            raise ValueError(f"least_angle_sine must be 0 to 1, not {self.least_angle_sine!r}")
        if not self.misfit > 0.0:
            raise ValueError(f"misfit must be positive, not {self.misfit!r}")

    def believes_compliance(self, compliance: float) -> bool:
        """Whether c = 1/s is positive with s in range; False for what is not a number."""
        return compliance > 0.0 and self.stiffness[0] * compliance <= 1.0 <= self.stiffness[1] * compliance

    def believes_radius(self, radius: float) -> bool:
        return self.radius[0] <= abs(radius) <= self.radius[1]

    def believes_fit(self, model: Model, newest: Sample) -> bool:
        """Whether a model says at its own newest sample about what that says."""
        return distance(model.at(newest.tick, newest.position), newest.value) <= self.misfit * norm(newest.value)


@dataclass(frozen=True, slots=True)
class Predictor:
    """One line of the table of predictors.

    Args:
        fit: the newest sample and the one before (None where there is none) to a model, or to None where no model of
            them can be trusted; never raises.
        needs_previous: whether the fit reads the sample before, so that an update must carry it.
        geometric: whether it reads the position, and so predicts forces only.
    """

    fit: Callable[[Sample, Sample | None, Trust], Model | None]
    needs_previous: Callable[[Sample, Sample], bool]
    geometric: bool = False

    def model(self, newest: Sample, previous: Sample | None, trust: Trust) -> Model:
        """The fit, or the newest sample held where there is none."""
        return self.fit(newest, previous, trust) or Hold(newest.value)


@dataclass(frozen=True, slots=True)
class Parametric:
    """A line of the table of predictors whose model travels as numbers.

    Args:
        widths: bits of each field, on the grids of a channel.
        levels: a model that is fitted to a newest sample, as fields; the model must be finite.
        build: the model again, of fields that may hold any bits, or None where they say none that can be trusted.
        geometric: whether it reads the position, and so predicts forces only.
    """

    widths: Callable[[Grids], tuple[int, ...]]
    levels: Callable[[Any, Sample, Grids], list[int]]
    build: Callable[[Sequence[int], Sample, Grids, Trust], Model | None]
    geometric: bool = False

    def packed(self, model: Model, newest: Sample, grids: Grids) -> tuple[int, tuple[int, ...]]:
        """The gap and the previous levels of the update that carries a model."""
        return pack(self.levels(model, newest, grids), self.widths(grids), grids.size)

    def model(self, gap: int, previous: Sequence[int], newest: Sample, grids: Grids, trust: Trust) -> Model:
        """What they say, or the newest sample held where that is nothing."""
        if not previous:
            return Hold(newest.value)
        return self.build(unpack(gap, previous, self.widths(grids)), newest, grids, trust) or Hold(newest.value)
