"""What the sections of a file are made of: their base, the names of predictors, and the shape of a deadband."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import fields
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, Self, get_type_hints

from pydantic import (
    AfterValidator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    SerializeAsAny,
    create_model,
    model_validator,
)
from pydantic_core.core_schema import CoreSchema, no_info_after_validator_function

from weberlink.codec.channel import unfit_for
from weberlink.codec.choice import CHOICES
from weberlink.codec.deadband import DEADBANDS, Deadband
from weberlink.codec.predictors import PREDICTORS, suits
from weberlink.config.errors import one_of
from weberlink.options import Options
from weberlink.registry import Registry
from weberlink.slave.scenes.settings import ByShape


class Settings(Options):
    """Keys of a file; unknown ones, and numbers that are not finite, are errors."""

    def contradictions(self) -> Iterator[str]:
        """Why settings that are right one by one do not go together."""
        yield from ()

    @model_validator(mode="after")
    def _go_together(self) -> Self:
        for line in self.contradictions():
            raise ValueError(line)
        return self


def rising(ends: tuple[float, float]) -> tuple[float, float]:
    if not ends[0] < ends[1]:
        raise ValueError(f"must rise, not [{ends[0]}, {ends[1]}]")
    return ends


Interval = Annotated[tuple[float, float], AfterValidator(rising)]


class PredictorFor:
    """Validates the name of a predictor that suits a signal (`weberlink.codec.predictors.suits`), or if `chosen` of a
    choice among several; imports no other one."""

    def __init__(self, signal: str, *, chosen: bool = False) -> None:
        self._signal = signal
        self._tables: tuple[Registry[Any], ...] = (PREDICTORS, CHOICES) if chosen else (PREDICTORS,)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return no_info_after_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return handler(schema) | {"enum": self._suitable()}

    def _check(self, name: str) -> str:
        for table in self._tables:
            if name in table.absent():
                table.check_known(name)  # says how to install it
            if name in table and self._suits(name):
                return name
        raise ValueError(one_of(self._suitable(), name))

    def _suits(self, name: str) -> bool:
        return name not in PREDICTORS or suits(name, self._signal)

    def _suitable(self) -> list[str]:
        """All names, without those of what cannot be imported."""
        known = []
        for name in (name for table in self._tables for name in table):
            with suppress(ImportError, ValueError):
                known += [name] if self._suits(name) else []
        return known


class PredictedSettings(Settings):
    """The predictors of a channel."""

    signal: ClassVar[str]  # as of `weberlink.codec.predictors.suits`

    predictor: str
    bank: tuple[str, ...]
    max_updates_per_s: float | None = Field(default=None, ge=1, le=10_000)
    """Largest rate of updates in the long run, after a burst of half a second's worth (at least 16): a signal that
    would send more widens the deadband smoothly. None for no limit. Updates that the link loses are sent again beside
    it."""

    @model_validator(mode="before")
    @classmethod
    def _usual_bank(cls, data: Any) -> Any:
        predictor = data.get("predictor") if isinstance(data, dict) else None
        if isinstance(predictor, str) and predictor in CHOICES and "bank" not in data:
            return {**data, "bank": CHOICES[predictor].bank(cls.signal)}
        return data

    def contradictions(self) -> Iterator[str]:
        if len(set(self.bank)) != len(self.bank):
            yield "bank: names each predictor once"
        misfits = unfit_for(self.predictor, self.bank) if self.predictor in CHOICES else []
        if misfits:
            yield f"bank: {self.predictor} does not make the models of {', '.join(misfits)}; use another choice"


class ShapeSettings(Settings):
    """The name of a deadband; a subclass has its options as fields (`weberlink.codec.deadband.Deadband`)."""

    shape: str

    @property
    def deadband(self) -> type[Deadband]:
        return DEADBANDS[self.shape]


@cache
def settings_of(shape: str) -> type[ShapeSettings]:
    """The settings of a shape: its options as fields."""
    deadband = DEADBANDS.load(shape)
    hints = get_type_hints(deadband.Options, include_extras=True)
    own: dict[str, Any] = {each.name: (hints[each.name], each.default) for each in fields(deadband.Options)}
    title = "".join(part.title() for part in shape.split("_")) + "Settings"
    tag: Any = Literal[shape]
    return create_model(title, __base__=ShapeSettings, __doc__=deadband.summary, shape=(tag, ...), **own)


DeadbandSettings = Annotated[SerializeAsAny[ShapeSettings], ByShape(settings_of, DEADBANDS)]
