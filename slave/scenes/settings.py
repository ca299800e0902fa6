"""The scene of a configuration file: its settings, and the `Scene` that they describe."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Annotated, Any, Union, cast

from pydantic import BaseModel, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter, create_model
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import PydanticCustomError
from pydantic_core.core_schema import CoreSchema, no_info_plain_validator_function

from weberlink.slave.scenes.scene import FrictionCone, Scene, SceneObject, Sway
from weberlink.slave.scenes.shape import SHAPES, CarvableSettings, CarvedShape, SceneShapeSettings


class ByShape:
    """Validates settings by the model of their `shape`, which `find` gives; only shapes that are named are imported."""

    def __init__(self, find: Callable[[str], type[BaseModel]], names: Iterable[str] = SHAPES.built_in) -> None:
        self._find = find
        self._names = names  # for the schema

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return no_info_plain_validator_function(self._validate)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        found = []
        for name in self._names:
            with suppress(ValueError):  # of a shape that cannot be carved
                found.append(self._find(name))
        union: Any = Union[tuple(found)]  # noqa: UP007 - of a table
        form: Any = union if len(found) == 1 else Annotated[union, Field(discriminator="shape")]
        return handler(TypeAdapter(form).core_schema)

    def _validate(self, value: object) -> BaseModel:
        name = value.get("shape") if isinstance(value, Mapping) else getattr(value, "shape", None)
        if name is None and not isinstance(value, Mapping):
            raise PydanticCustomError("model_attributes_type", "should be a mapping of keys")
        if name is None:
            raise PydanticCustomError("union_tag_not_found", "shape is missing")
        return self._find(str(name)).model_validate(value)


def carvable(name: str) -> type[CarvableSettings]:
    settings = SHAPES.load(name)
    if not issubclass(settings, CarvableSettings):
        raise ValueError(f"shape: {name} cannot be cut out of another shape")  # noqa: TRY004 - a wrong setting
    return settings


class ObjectSettings(SceneShapeSettings):
    """The properties of an object's surface. What is not given is not computed."""

    stiffness_n_m: float = Field(ge=1e-3, le=1e9)
    friction: FrictionCone | None = None
    damping_n_s_m: float | None = Field(default=None, ge=0.0, le=1e6, description="along the normal; never pulls")
    motion: Sway | None = None
    carve: tuple[Annotated[CarvableSettings, ByShape(carvable)], ...] = Field(
        default=(), description="shapes cut out of this one"
    )

    def thing(self) -> SceneObject:
        shape = self.solid()
        if self.carve:
            shape = CarvedShape(shape, [cut.hollow() for cut in self.carve])
        return SceneObject(shape, self.stiffness_n_m, self.friction, self.damping_n_s_m, self.motion)


@lru_cache
def object_model(name: str) -> type[ObjectSettings]:
    """The settings of an object of this shape: those of the shape and those of a surface; raises ValueError if there is
    no such shape.
    """
    title = "".join(word.capitalize() for word in name.split("_")) + "Object"
    bases = (SHAPES.load(name), ObjectSettings)
    return cast(
        type[ObjectSettings], create_model(title, __base__=bases, __doc__=f"A {name.replace('_', ' ')} to touch.")
    )


SceneSettings = tuple[Annotated[ObjectSettings, ByShape(object_model)], ...]  # The `scene:` list of a file


def build(objects: Sequence[ObjectSettings]) -> Scene:
    """The scene that the settings describe; raises ValueError if a height field file is missing, not numeric or not
    rectangular.
    """
    return Scene([settings.thing() for settings in objects])
