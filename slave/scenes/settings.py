"""The scene of a configuration file: its settings, and the `Scene` that they describe."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Annotated, Any, TypeVar, Union, cast

from pydantic import (
    BaseModel,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationError,
    create_model,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import InitErrorDetails, PydanticCustomError
from pydantic_core.core_schema import CoreSchema, no_info_plain_validator_function

from weberlink.slave.scenes.contact import FrictionCone, SceneObject, Sway
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.shape import SHAPES, CarvableSettings, SceneShapeSettings
from weberlink.slave.scenes.solids import CarvedShape

M = TypeVar("M", bound=BaseModel)


class ByShape:
    """Validates settings by the model of their `shape`; only shapes that are named are imported.

    Args:
        find: the model of a shape; raises ValueError where there is none.
    """

    def __init__(self, find: Callable[[str], type[SceneShapeSettings]]) -> None:
        self._find = find

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return no_info_plain_validator_function(self._validate)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        union: Any = Union[tuple(built_in(self._find))]  # noqa: UP007 - of a table
        return handler(TypeAdapter(Annotated[union, Field(discriminator="shape")]).core_schema)

    def _validate(self, value: object) -> SceneShapeSettings:
        name = value.get("shape") if isinstance(value, Mapping) else getattr(value, "shape", None)
        if name is None and not isinstance(value, Mapping):
            raise PydanticCustomError("model_attributes_type", "should be a mapping of keys")
        if name is None:
            raise PydanticCustomError("union_tag_not_found", "shape is missing")
        return validated(str(name) if name in SHAPES.built_in else None, self._find(str(name)), value)


def validated(tag: str | None, model: type[M], value: object) -> M:
    """Settings of a model; errors have the tag, if any, in their location, as those of a tagged union have."""
    try:
        return model.model_validate(value)
    except ValidationError as error:
        if tag is None:
            raise
        details = [
            InitErrorDetails(type=each["type"], loc=(tag, *each["loc"]), input=each["input"], ctx=each.get("ctx", {}))
            for each in error.errors(include_url=False)
        ]
        raise ValidationError.from_exception_data(error.title, details) from None


def built_in(find: Callable[[str], type[SceneShapeSettings]]) -> Iterator[type[SceneShapeSettings]]:
    """The models of the shapes of the kernel, without those that `find` refuses."""
    for name in SHAPES.built_in:
        with suppress(ValueError):
            yield find(name)


def carvable(name: str) -> type[CarvableSettings]:
    settings = SHAPES.load(name)
    if not issubclass(settings, CarvableSettings):
        raise ValueError(f"shape: {name} cannot be cut out of another shape")  # noqa: TRY004 - a wrong setting
    return settings


class CutSettings(CarvableSettings):
    """A shape that is cut out of another one."""

    @classmethod
    def variants(cls) -> list[type[SceneShapeSettings]]:
        """For messages."""
        return list(built_in(carvable))


class ObjectSettings(SceneShapeSettings):
    """The properties of an object's surface. What is not given is not computed."""

    stiffness_n_m: float = Field(ge=1e-3, le=1e9)
    friction: FrictionCone | None = None
    damping_n_s_m: float | None = Field(default=None, ge=0.0, le=1e6, description="along the normal; never pulls")
    motion: Sway | None = None
    carve: tuple[Annotated[CutSettings, ByShape(carvable)], ...] = Field(
        default=(), description="shapes cut out of this one"
    )

    @classmethod
    def variants(cls) -> list[type[SceneShapeSettings]]:
        """For messages."""
        return list(built_in(object_model))

    def thing(self) -> SceneObject:
        shape = self.solid()
        if self.carve:
            shape = CarvedShape(shape, [cut.hollow() for cut in self.carve])
        return SceneObject(shape, self.stiffness_n_m, self.friction, self.damping_n_s_m, self.motion)


@lru_cache
def object_model(name: str) -> type[ObjectSettings]:
    """The settings of an object of this shape: those of the shape and those of a surface.

    Raises:
        ValueError: there is no such shape.
    """
    title = "".join(word.capitalize() for word in name.split("_")) + "Object"
    bases = (SHAPES.load(name), ObjectSettings)
    return cast(
        type[ObjectSettings], create_model(title, __base__=bases, __doc__=f"A {name.replace('_', ' ')} to touch.")
    )


SceneSettings = tuple[Annotated[ObjectSettings, ByShape(object_model)], ...]
"""The `scene:` list of a configuration file."""


def build(objects: Sequence[ObjectSettings]) -> Scene:
    """The scene that the settings describe.

    Raises:
        ValueError: A height field file is missing, not numeric or not rectangular.
    """
    things = [settings.thing() for settings in objects]
    if all(thing.motion is None for thing in things):
        return Scene(things)
    from weberlink.slave.scenes.moving import MovingScene  # noqa: PLC0415 - where something moves

    return MovingScene(things)
