"""The scene of a configuration file: its settings, and the `Scene` that they describe."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Self, Union, cast

from pydantic import (
    BaseModel,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    TypeAdapter,
    create_model,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import PydanticCustomError
from pydantic_core.core_schema import CoreSchema, no_info_plain_validator_function

from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.scene import Scene, Wave
from weberlink.slave.scenes.shape import SHAPES, CarvableSettings, SceneModel, SceneShapeSettings, UnitVector

if TYPE_CHECKING:
    from weberlink.slave.scenes.moving import Sway

FASTEST_M_S = 10.0
"""Peak speed of a moving object: a centimetre per tick, faster than any robot or hand."""


class FrictionSettings(SceneModel):
    """Coulomb friction: sticks within static x normal force, slides at dynamic x normal force."""

    static: float = Field(ge=0.0, le=2.0)
    dynamic: float = Field(ge=0.0, le=2.0)

    @model_validator(mode="after")
    def check_order(self) -> Self:
        if self.dynamic > self.static:
            raise ValueError(f"dynamic: expected at most static ({self.static}), got {self.dynamic}")
        return self


class MotionSettings(SceneModel):
    """The object oscillates about its configured position, independent of the probe. Time is that of the robot."""

    direction: UnitVector = Field(default=(0.0, 0.0, 1.0), description="of any length; it is normalised")
    amplitude_m: float = Field(gt=0.0, le=10.0, description="from the middle to either end")
    frequency_hz: float = Field(gt=0.0, le=50.0)
    phase_deg: float = Field(
        default=0.0, ge=-360.0, le=360.0, description="at 0 it begins in the middle, moving along the direction"
    )
    wave: Wave = Field(
        default="sine",
        description="sine: at most 2 pi frequency amplitude fast; triangle: always 4 frequency amplitude",
    )

    @model_validator(mode="after")
    def check_speed(self) -> Self:
        speed = self.sway().speed
        if speed > FASTEST_M_S:
            raise ValueError(
                f"amplitude_m, frequency_hz: expected a peak speed of at most {FASTEST_M_S:g} m/s, got {speed:.3g} m/s"
            )
        return self

    def sway(self) -> "Sway":
        from weberlink.slave.scenes.moving import Sway  # noqa: PLC0415 - where something moves

        return Sway(self.direction, self.amplitude_m, self.frequency_hz, self.phase_deg / 360.0, self.wave)


class ByShape:
    """Validates settings by the model of their `shape`; only shapes that are named are imported.

    Args:
        find: the model of a shape; raises ValueError where there is none.
        built_in: the shapes of the kernel.
    """

    def __init__(self, find: Callable[[str], type[BaseModel]], built_in: Iterable[str] = SHAPES.built_in) -> None:
        self._find = find
        self._built_in = built_in

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return no_info_plain_validator_function(self._validate)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        found = []
        for name in self._built_in:
            with suppress(ValueError):  # of a shape that cannot be carved
                found.append(self._find(name))
        union: Any = Union[tuple(found)]  # noqa: UP007 - of a table
        return handler(TypeAdapter(Annotated[union, Field(discriminator="shape")]).core_schema)

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


class CutSettings(CarvableSettings):
    """A shape that is cut out of another one."""


Cut = Annotated[CutSettings, ByShape(carvable)]


class ObjectSettings(SceneShapeSettings):
    """The properties of an object's surface. What is not given is not computed."""

    stiffness_n_m: float = Field(ge=1e-3, le=1e9)
    friction: FrictionSettings | None = None
    damping_n_s_m: float | None = Field(default=None, ge=0.0, le=1e6, description="along the normal; never pulls")
    motion: MotionSettings | None = None
    carve: tuple[Cut, ...] = Field(default=(), description="shapes cut out of this one")


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
    things = [scene_object(settings) for settings in objects]
    if all(settings.motion is None for settings in objects):
        return Scene(things)
    from weberlink.slave.scenes.moving import MovingScene  # noqa: PLC0415 - where something moves

    return MovingScene(things, [None if settings.motion is None else settings.motion.sway() for settings in objects])


def scene_object(settings: ObjectSettings) -> SceneObject:
    shape = settings.solid()
    if settings.carve:
        from weberlink.slave.scenes.derived import CarvedShape  # noqa: PLC0415 - where something is cut out

        shape = CarvedShape(shape, [cut.hollow() for cut in settings.carve])
    cone = settings.friction
    friction = None if cone is None else FrictionCone(cone.static, cone.dynamic)
    return SceneObject(shape, settings.stiffness_n_m, friction, settings.damping_n_s_m)
