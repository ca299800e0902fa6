"""The scene of a configuration file: its settings, and the `Scene` that they describe."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar, Union, cast

from pydantic import Field, SerializeAsAny, ValidatorFunctionWrapHandler, WrapValidator, create_model, model_validator

from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.derived import CarvedShape
from weberlink.slave.scenes.moving import MovingScene, Sway, Wave
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.shape import SHAPES, CarvableSettings, SceneModel, SceneShapeSettings, UnitVector

FASTEST_M_S = 10.0
"""Peak speed of a moving object: a centimetre per tick, faster than any robot or hand."""

ShapeModel = TypeVar("ShapeModel", bound=SceneShapeSettings)


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

    def sway(self) -> Sway:
        return Sway(self.direction, self.amplitude_m, self.frequency_hz, self.phase_deg / 360.0, self.wave)


def by_shape(built_in: Mapping[str, type[ShapeModel]], find: Callable[[str], type[ShapeModel]]) -> Any:
    """The type of a field: one of the built-in settings, told apart by `shape`, or those that `find` gives."""

    def validate(value: object, validate_built_in: ValidatorFunctionWrapHandler) -> object:
        name = value.get("shape") if isinstance(value, Mapping) else getattr(value, "shape", None)
        if not isinstance(name, str) or name in SHAPES.built_in:
            return validate_built_in(value)
        return find(name).model_validate(value)

    union: Any = Union[tuple(built_in.values())]  # noqa: UP007 - of a table
    serialized: Any = SerializeAsAny
    return Annotated[union, Field(discriminator="shape"), WrapValidator(validate), serialized()]


def carvable(name: str) -> type[CarvableSettings]:
    settings = SHAPES.load(name)
    if not issubclass(settings, CarvableSettings):
        raise ValueError(f"shape: {name} cannot be cut out of another shape")  # noqa: TRY004 - a wrong setting
    return settings


BUILT_IN = {name: SHAPES.load(name) for name in SHAPES.built_in}

if TYPE_CHECKING:
    Cavity = CarvableSettings
else:
    Cavity = by_shape({name: each for name, each in BUILT_IN.items() if issubclass(each, CarvableSettings)}, carvable)


class ObjectSettings(SceneShapeSettings):
    """The properties of an object's surface. What is not given is not computed."""

    stiffness_n_m: float = Field(ge=1e-3, le=1e9)
    friction: FrictionSettings | None = None
    damping_n_s_m: float | None = Field(default=None, ge=0.0, le=1e6, description="along the normal; never pulls")
    motion: MotionSettings | None = None
    carve: tuple[Cavity, ...] = Field(default=(), description="shapes cut out of this one")


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


def object_settings(**keys: object) -> ObjectSettings:
    """The settings of an object with the keys that a configuration file would have."""
    return object_model(str(keys["shape"])).model_validate(keys)


if TYPE_CHECKING:
    AnyObject = ObjectSettings
else:
    AnyObject = by_shape({name: object_model(name) for name in BUILT_IN}, object_model)
SceneSettings = tuple[AnyObject, ...]
"""The `scene:` list of a configuration file."""


def build(objects: Sequence[ObjectSettings]) -> Scene:
    """The scene that the settings describe.

    Raises:
        ValueError: A height field file is missing, not numeric or not rectangular.
    """
    things = [scene_object(settings) for settings in objects]
    if all(settings.motion is None for settings in objects):
        return Scene(things)
    return MovingScene(things, [None if settings.motion is None else settings.motion.sway() for settings in objects])


def scene_object(settings: ObjectSettings) -> SceneObject:
    shape = settings.solid()
    if settings.carve:
        shape = CarvedShape(shape, [cut.hollow() for cut in settings.carve])
    cone = settings.friction
    friction = None if cone is None else FrictionCone(cone.static, cone.dynamic)
    return SceneObject(shape, settings.stiffness_n_m, friction, settings.damping_n_s_m)
