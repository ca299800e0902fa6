"""Numba, told how to read the codec: its functions by name, its classes as named tuples of the same fields.

Owns the one compiled function, and where it is kept. A compiled function is kept on disk (beside this file, or where
numba keeps such things for a user), under a digest of all the source that went into it: numba itself looks at one file
only, and would go on with yesterday's codec. Where nothing can be written it is compiled anew in each process.
"""

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from inspect import getattr_static, getmembers, getsourcefile, isfunction, signature
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types
from numba.extending import overload, overload_method, register_jitable

from weberlink.codec import Channel, channel, quantizer, sample, update
from weberlink.codec.deadband import (
    ConeDeadband,
    ForceDeadband,
    LevelCrossingDeadband,
    VelocityDeadband,
    cone,
    isotropic,
    level_crossing,
    position,
    velocity,
)
from weberlink.codec.deadband import contract as deadband
from weberlink.codec.predictors import Trust, contact, contract, hold, linear, plane, sphere, zoh
from weberlink.codec.predictors.hold import Hold
from weberlink.codec.quantizer import Quantizer
from weberlink.geometry import vector
from weberlink.geometry.vector import Vector
from weberlink.studies.evaluate.compiled import loop

SOURCES: tuple[ModuleType, ...] = (
    channel, cone, contact, contract, deadband, hold, isotropic, level_crossing, linear, loop, plane, position,
    quantizer, sample, sphere, update, vector, velocity, zoh,
)  # fmt: skip
"""All that is compiled."""


class TrustFields(NamedTuple):
    stiffness: tuple[float, float]
    radius: tuple[float, float]
    least_angle_sine: float
    misfit: float


class IsotropicFields(NamedTuple):
    weber: float
    floor: float
    which: int
    reads_motion: bool


class ConeFields(NamedTuple):
    weber: float
    floor: float
    widest: float
    reads_motion: bool


class LevelCrossingFields(NamedTuple):
    floor: float
    hysteresis: float
    widest: float
    spacing: float
    knee: float
    powers: tuple[float, ...]
    reads_motion: bool


class VelocityFields(NamedTuple):
    weber: float
    floor: float
    which: int
    per_metre: float
    highest: float
    reads_motion: bool


DEADBANDS: dict[type, Any] = {
    ForceDeadband: IsotropicFields,
    ConeDeadband: ConeFields,
    LevelCrossingDeadband: LevelCrossingFields,
    VelocityDeadband: VelocityFields,
}
"""Those of a force that can be compiled, and what is read of each. Each is compiled by itself."""


class QuantizerFields(NamedTuple):
    step: float
    lowest: Vector
    highest: Vector


class ChannelFields(NamedTuple):
    value_quantizer: QuantizerFields
    position_quantizer: QuantizerFields
    deadband: Any
    trust: TrustFields


_CLASSES: dict[type, type] = {
    TrustFields: Trust,
    **{fields: made for made, fields in DEADBANDS.items()},
    QuantizerFields: Quantizer,
    ChannelFields: Channel,
}
"""Whose methods the fields have; no field may be called like a method of any of them."""
_METHODS: tuple[Callable[..., Any], ...] = (
    Hold.at,
    ForceDeadband.bound,
    ConeDeadband.error,
    Channel.displayable,
    Channel.place,
    Quantizer.confine,
    Quantizer.says,
    Quantizer.rounded,
    Trust.believes_compliance,
    Trust.believes_radius,
    Trust.believes_fit,
)
"""One of each name; models of other classes have an `at` like this."""


def fields_of(channel: Channel) -> ChannelFields:
    """A force channel as the compiled function takes it."""
    kind = DEADBANDS[type(channel.deadband)]
    assert channel.position_quantizer is not None
    force, position = (
        QuantizerFields(grid.step, grid.lowest, grid.highest)
        for grid in (channel.value_quantizer, channel.position_quantizer)
    )
    trust = channel.trust
    return ChannelFields(
        force,
        position,
        kind(*(getattr(channel.deadband, name) for name in kind._fields)),
        TrustFields(trust.stiffness, trust.radius, trust.least_angle_sine, trust.misfit),
    )


@cache
def compiled() -> Callable[..., int]:
    """`loop.run`, to be compiled on its first call or read from where it was kept."""
    _teach()
    digest = int.from_bytes(sha256(b"".join(_source(module) for module in SOURCES)).digest()[:7])
    try:
        return _entry(digest, keep=True)
    except RuntimeError:  # numba found no folder to write to
        return _entry(digest, keep=False)


def _entry(digest: int, *, keep: bool) -> Callable[..., int]:
    run = loop.run

    def entry(
        channel: Any, bank: loop.Integers, force: loop.Array, position: loop.Array, ticks: loop.Ticks, sends: loop.Sends
    ) -> int:
        # Numba tells one kept function from another by what it encloses, too.
        return run(channel, bank, force, position, ticks, sends) if digest >= 0 else 0

    made: Callable[..., int] = numba.njit(cache=keep, error_model="python")(entry)
    return made


def _teach() -> None:
    for module in SOURCES:
        for _, function in getmembers(module, isfunction):
            if function.__module__ == module.__name__ and function is not quantizer.level:
                register_jitable(function)
    overload(quantizer.level, strict=False)(_level)
    for method in _METHODS:
        overload_method(types.BaseNamedTuple, method.__name__)(_resolved(method))


def _level(component: Any, step: Any) -> Callable[..., float]:  # noqa: ARG001 - types, which decide nothing here
    """A level as a float: the integers of a machine end at 2^63, and have no zero with a sign."""

    def level(component: float, step: float) -> float:
        return float(np.rint(component / step) + 0.0)

    return level


def _resolved(method: Callable[..., Any]) -> Callable[..., Any]:
    """What tells numba the method of that name of a named tuple, whichever class it is or stands for."""

    def resolve(self: Any, *_arguments: Any) -> Callable[..., Any] | None:
        owner = _CLASSES.get(self.instance_class, self.instance_class)
        found: Callable[..., Any] | None = getattr(owner, method.__name__, None)
        return _with_self(found) if isinstance(getattr_static(owner, method.__name__, None), staticmethod) else found

    resolve.__signature__ = signature(method)  # type: ignore[attr-defined]
    return resolve


def _with_self(function: Any) -> Callable[..., Any]:
    """A function that stands as a method, for which `ConeDeadband.error` is the pattern."""

    def error(self: Any, displayed: Vector, actual: Vector) -> Any:  # noqa: ARG001
        return function(displayed, actual)

    error.__signature__ = signature(ConeDeadband.error)  # type: ignore[attr-defined]
    return error


def _source(module: ModuleType) -> bytes:
    path = getsourcefile(module)
    assert path is not None
    return Path(path).read_bytes()
