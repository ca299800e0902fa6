"""What a configuration file may say of the shape of the force's deadband: made from the registry of deadbands."""

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, SerializeAsAny, create_model

from weberlink.codec.deadband import DEADBANDS, ISOTROPIC, Deadband
from weberlink.slave.scenes.settings import validated


class Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ShapeSettings(BaseModel):
    """The name of a deadband; its options are the fields of a subclass."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    shape: str

    @classmethod
    def variants(cls) -> list[type["ShapeSettings"]]:
        """The settings of all shapes, for messages: the built-in ones and those made so far."""
        for name in DEADBANDS.built_in:
            settings_of(name)
        return cls.__subclasses__()

    @property
    def deadband(self) -> type[Deadband]:
        return DEADBANDS[self.shape]

    @property
    def options(self) -> dict[str, float]:
        return self.model_dump(exclude={"shape"})


@cache
def settings_of(shape: str) -> type[ShapeSettings]:
    """The settings of a shape: its options as fields."""
    deadband = DEADBANDS[shape]
    fields: dict[str, Any] = {
        name: (
            float,
            Field(
                default=option.default,
                ge=option.least,
                gt=option.above,
                le=option.most,
                description=option.text,
            ),
        )
        for name, option in deadband.options.items()
    }
    title = "".join(part.title() for part in shape.split("_")) + "Settings"
    fields = {"shape": (Literal[shape], ...)} | fields
    return create_model(title, __base__=ShapeSettings, __doc__=deadband.summary, **fields)


def _settings(data: Any) -> Any:
    """The settings of the shape that is named; errors have it in their location, as a tagged union has."""
    if not (isinstance(data, Mapping) and isinstance(data.get("shape"), str)):
        return data
    shape = DEADBANDS.check_known(data["shape"])
    return validated(shape, settings_of(shape), data)


DeadbandSettings = Annotated[SerializeAsAny[ShapeSettings], BeforeValidator(_settings)]
ISOTROPIC_SETTINGS = settings_of(ISOTROPIC)(shape=ISOTROPIC)
