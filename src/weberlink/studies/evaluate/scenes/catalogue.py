"""The scenes of the study by name: what there is to touch, and how a hand finds it."""

from dataclasses import dataclass

from weberlink.slave.scenes.height_field import BumpSettings
from weberlink.slave.scenes.settings import FrictionSettings, MotionSettings, ObjectSettings, object_settings
from weberlink.studies.evaluate.scenes.charts import Chart, ball, bowl, level

RADIUS_M = 0.05
HOLLOW_M = 0.06
BUMP_M = 0.005
RUBBING = FrictionSettings(static=0.3, dynamic=0.3)
HEAVING = MotionSettings(amplitude_m=0.016, frequency_hz=1.0)
"""Along the normal, at most 0.1 m/s fast."""
SLIDING = MotionSettings(direction=(1.0, 0.0, 0.0), amplitude_m=0.03, frequency_hz=0.4)
"""Along the surface, at most 0.075 m/s fast."""


@dataclass(frozen=True, slots=True)
class Explored:
    """A scene of one object.

    Args:
        thing: as a configuration file would write it.
        chart: where its surface is, in the eyes of the hand.
        reach_m: how far the hand goes from the middle.
        force_n: the gentlest and the firmest touch that is meant.
    """

    thing: ObjectSettings
    chart: Chart
    reach_m: float = 0.04
    force_n: tuple[float, float] = (0.7, 4.5)


def plane(
    stiffness: float,
    *,
    friction: FrictionSettings | None = None,
    damping: float | None = None,
    motion: MotionSettings | None = None,
) -> ObjectSettings:
    return object_settings(
        shape="plane", stiffness_n_m=stiffness, friction=friction, damping_n_s_m=damping, motion=motion
    )


def sphere(friction: FrictionSettings | None = None) -> ObjectSettings:
    return object_settings(
        shape="sphere", center_m=(0.0, 0.0, -RADIUS_M), radius_m=RADIUS_M, stiffness_n_m=800.0, friction=friction
    )


FLAT = level(0.0)
ROUND = ball((0.0, 0.0, -RADIUS_M), RADIUS_M)

SCENES: dict[str, Explored] = {
    "plane": Explored(plane(500.0), FLAT),
    "sphere": Explored(sphere(), ROUND),
    "sphere_cavity": Explored(
        object_settings(
            shape="sphere", center_m=(0.0, 0.0, HOLLOW_M), radius_m=HOLLOW_M, side="inside", stiffness_n_m=600.0
        ),
        bowl((0.0, 0.0, HOLLOW_M), HOLLOW_M),
    ),
    "box": Explored(
        object_settings(shape="box", center_m=(0.0, 0.0, -0.02), size_m=(0.06, 0.06, 0.04), stiffness_n_m=700.0),
        FLAT,
        0.036,
    ),
    "height_field": Explored(
        object_settings(
            shape="height_field", bumps=BumpSettings(amplitude_m=BUMP_M, wavelength_m=0.02), stiffness_n_m=700.0
        ),
        level(BUMP_M / 4.0),
    ),
    "stiff_plane": Explored(plane(3000.0, damping=6.0), FLAT),
    "soft_plane": Explored(plane(200.0, damping=4.0), FLAT),
    "plane_friction": Explored(plane(500.0, friction=RUBBING), FLAT),
    "sphere_friction": Explored(sphere(RUBBING), ROUND),
    "plane_moving": Explored(plane(500.0, motion=HEAVING), FLAT, force_n=(1.5, 4.5)),
    "plane_sliding": Explored(plane(500.0, friction=RUBBING, motion=SLIDING), FLAT),
}
