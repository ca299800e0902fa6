"""The published parameter sets of the mechanisms, each with where it was read and what is doubtful about it."""

from dataclasses import dataclass, replace

from master.devices.polhem.drive import Counts, Drive, Signs
from master.devices.polhem.five_bar import FiveBar
from master.devices.polhem.linkage import SerialParallelogram
from master.devices.polhem.mechanism import Mechanism

HFABAPI = "forsslund/hfabapi, 2026-06-10"
HAPTIKFABRIKENAPI = "forsslund/haptikfabrikenapi, 2021-06-10"
WOODY_EXPERIMENTAL = "WoodenHaptics/woody-experimental"

BEYOND_HOME_M = 0.05


@dataclass(frozen=True)
class Parameters:
    """A mechanism with what its makers say of it.

    Args:
        name: of the set.
        mechanism: with directions and home counts as on the serial port, where it has one.
        force_n: largest force [N].
        stiffness_n_m: stiffest spring that it shows stably [N/m].
        damping_n_s_m: strongest damper [N s/m].
        radius_m: of the workspace about its middle [m].
        source: where all this was read.
        warnings: what to know before it is believed.
        hid_directions: where they are others with the boards that speak HID.
        gimbal_reversed_over_hid: whether the gimbal's counters come last to first there.
    """

    name: str
    mechanism: Mechanism
    force_n: float
    stiffness_n_m: float
    damping_n_s_m: float
    radius_m: float
    source: str
    warnings: tuple[str, ...] = ()
    hid_directions: Signs | None = None
    gimbal_reversed_over_hid: bool = False

    @property
    def reach_m(self) -> float:
        """Farthest from the middle along any axis that the handle can credibly be [m]: its home pose is there."""
        home = self.mechanism.position((0, 0, 0))
        return max(2.0 * self.radius_m, max(map(abs, home)) + BEYOND_HOME_M)

    def without_gimbal(self) -> "Parameters":
        drive = replace(self.mechanism.drive, gimbal_counts_per_turn=(0, 0, 0))
        return replace(self, mechanism=replace(self.mechanism, drive=drive))

    def over_hid(self) -> "Parameters":
        """As the boards that speak HID turn the counters."""
        return self if self.hid_directions is None else self.turned(self.hid_directions, None)

    def turned(self, directions: Signs | None, home_counts: Counts | None) -> "Parameters":
        """With other directions and home counts; None for as they are."""
        drive = self.mechanism.drive
        drive = replace(
            drive,
            directions=drive.directions if directions is None else directions,
            home_counts=drive.home_counts if home_counts is None else home_counts,
        )
        return replace(self, mechanism=replace(self.mechanism, drive=drive))


def _woodenhaptics(name: str, torque_constants: tuple[float, float, float], directions: Signs) -> Parameters:
    drive = Drive(
        (0.010, 0.010, 0.010),
        (0.160, 0.120, 0.120),
        (2000, 2000, 2000),
        directions,
        (0, 0, -6000),
        torque_constants,
    )
    linkage = SerialParallelogram(0.080, 0.205, 0.245, (0.220, 0.0, 0.080))
    return Parameters(
        name,
        Mechanism(drive, linkage),
        force_n=5.0,
        stiffness_n_m=1000.0,
        damping_n_s_m=8.0,
        radius_m=0.1,
        source=f"{HFABAPI}; {HAPTIKFABRIKENAPI}",
        hid_directions=(-1, -1, -1),
    )


WOODENHAPTICS_2015 = _woodenhaptics("woodenhaptics_2015", (0.0259, 0.0259, 0.0259), (1, -1, -1))

WOODENHAPTICS_2019 = replace(
    _woodenhaptics("woodenhaptics_2019", (0.321, 0.0603, 0.0603), (-1, -1, -1)),
    source=HFABAPI,
    warnings=("motor A has 12 times the torque constant of woodenhaptics_2015: the wrong set is a wrong force on A",),
)

ALUHAPTICS_V2 = Parameters(
    "aluhaptics_v2",
    Mechanism(
        Drive(
            (0.0138, 0.0098, 0.0098),
            (0.116, 0.076, 0.076),
            (2000, 2000, 2000),
            (-1, -1, -1),
            (0, 0, -3878),
            (0.0259, 0.0259, 0.0259),
        ),
        SerialParallelogram(0.111, 0.140, 0.111, (0.140, 0.0, 0.0)),
    ),
    force_n=5.0,
    stiffness_n_m=1000.0,
    damping_n_s_m=8.0,
    radius_m=0.1,
    source=f"{HFABAPI}; {HAPTIKFABRIKENAPI}; home pose: {WOODY_EXPERIMENTAL}",
    warnings=("its home pose, upper arm upright and forearm level, is inferred from the older driver",),
)

VINTAGE_PHANTOM = Parameters(
    "vintage_phantom",
    Mechanism(
        Drive(
            (0.013, 0.010, 0.010),
            (0.117, 0.077, 0.077),
            (4000, 4000, 4000),
            (-1, 1, -1),
            (0, 7700, 0),
            (0.0234, 0.0234, 0.0234),
            gimbal_counts_per_turn=(2000, 2000, 2000),
            gimbal_directions=(-1, 1, -1),
        ),
        SerialParallelogram(0.0, 0.138, 0.112, (0.138, 0.0, -0.097)),
        gimbal_axes="zyx",
    ),
    force_n=5.0,
    stiffness_n_m=800.0,
    damping_n_s_m=8.0,
    radius_m=0.1,
    source=HFABAPI,
    warnings=(
        "a SensAble PHANTOM with new electronics; the motors are taken for Maxon 118752, 'most likely' says the source",
        "the older source has other lengths and torque constants (vintage_phantom_2021)",
        "the forearm's part in the orientation is inferred: the source computes it for the Polhem only",
    ),
)

VINTAGE_PHANTOM_2021 = Parameters(
    "vintage_phantom_2021",
    Mechanism(
        Drive(
            (0.013, 0.010, 0.010),
            (0.117, 0.077, 0.077),
            (4000, 4000, 4000),
            (1, 1, 1),
            (0, 7700, 0),
            (0.0163, 0.0163, 0.0163),
        ),
        SerialParallelogram(0.056, 0.138, 0.112, (0.140, 0.0, 0.0)),
    ),
    force_n=5.0,
    stiffness_n_m=800.0,
    damping_n_s_m=8.0,
    radius_m=0.1,
    source=HAPTIKFABRIKENAPI,
    warnings=("its source names no home pose: that of vintage_phantom is taken",),
)

POLHEM_V1 = Parameters(
    "polhem_v1",
    Mechanism(
        Drive(
            (0.010, 0.010, 0.010),
            (0.180, 0.100, 0.100),
            (2000, 2000, 2000),
            (-1, -1, -1),
            (0, 0, -5000),
            (0.0538, 0.0538, 0.0538),
            gimbal_counts_per_turn=(1024, 1024, 1024),
            gimbal_directions=(-1, 1, -1),
        ),
        SerialParallelogram(0.058, 0.174, 0.133, (0.140, 0.0, 0.100)),
    ),
    force_n=5.0,
    stiffness_n_m=800.0,
    damping_n_s_m=8.0,
    radius_m=0.1,
    source=f"{HFABAPI}; {HAPTIKFABRIKENAPI}",
    gimbal_reversed_over_hid=True,
)

_FIVE_BAR = (0.034, 0.165, 0.025, 0.190, 0.034, 0.1308)

POLHEM_V2 = Parameters(
    "polhem_v2",
    Mechanism(
        Drive(
            (0.0288, 0.0130, 0.010),
            (0.175, 0.100, 0.100),
            (4096, 4096, 4096),
            (1, -1, 1),
            (8327, -10926, 27140),
            (0.321, 0.0538, 0.0538),
            gimbal_counts_per_turn=(1024, 1024, 1024),
            gimbal_directions=(-1, -1, -1),
            gimbal_home_counts=(0, 30, 0),
        ),
        FiveBar(*_FIVE_BAR, (0.137, 0.0, 0.0)),
    ),
    force_n=5.0,
    stiffness_n_m=2000.0,
    damping_n_s_m=1.0,
    radius_m=0.15,
    source=f"{HAPTIKFABRIKENAPI}, where polhem_v3 has these numbers too",
    warnings=("motor A has 5 times the torque constant of polhem_v3: the wrong set is a wrong force on A",),
    gimbal_reversed_over_hid=True,
)

POLHEM_V3 = Parameters(
    "polhem_v3",
    Mechanism(
        Drive(
            (0.0288534, 0.0136981, 0.0137281),
            (0.175, 0.100, 0.100),
            (4096, 4096, 4096),
            (1, -1, 1),
            (8312, -10366, 19764),
            (0.0603, 0.0538, 0.0538),
            gimbal_counts_per_turn=(1024, 1024, 1024),
            gimbal_directions=(-1, -1, -1),
            gimbal_home_counts=(0, 30, 0),
        ),
        FiveBar(*_FIVE_BAR, (0.2045, 0.0, 0.0325)),
    ),
    force_n=5.0,
    stiffness_n_m=2000.0,
    damping_n_s_m=1.0,
    radius_m=0.15,
    source=HFABAPI,
    gimbal_reversed_over_hid=True,
)

PARAMETERS: dict[str, Parameters] = {
    each.name: each
    for each in (
        WOODENHAPTICS_2015,
        WOODENHAPTICS_2019,
        ALUHAPTICS_V2,
        VINTAGE_PHANTOM,
        VINTAGE_PHANTOM_2021,
        POLHEM_V1,
        POLHEM_V2,
        POLHEM_V3,
    )
}

MODEL_SETS = {1: "polhem_v3", 2: "vintage_phantom", 3: "woodenhaptics_2015"}
"""The set of a device by the model number that it gives on the serial port."""
