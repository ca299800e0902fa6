"""The published parameter sets of the mechanisms, each with where it was read and what is doubtful about it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from weberlink.master.devices.polhem.drive import Counts, Drive, Signs, Triple
from weberlink.master.devices.polhem.five_bar import FiveBar
from weberlink.master.devices.polhem.linkage import SerialParallelogram
from weberlink.master.devices.polhem.mechanism import Mechanism
from weberlink.master.devices.polhem.weight import FiveBarWeight, Link, ParallelogramWeight, Weight

HFABAPI = "forsslund/hfabapi, 2026-06-10"
HAPTIKFABRIKENAPI = "forsslund/haptikfabrikenapi, 2021-06-10"
WOODY_EXPERIMENTAL = "WoodenHaptics/woody-experimental, CWoodenDevice.cpp"

BEYOND_HOME_M = 0.05

Board = Literal["serial", "hid14", "hid8"]
"""The electronics: a Teensy on a serial port, or an mbed with HID reports of 14 or 8 bytes."""


@dataclass(frozen=True)
class Wiring:
    """The signs and home counts of a mechanism on one kind of board.

    The boards count differently: the firmware with 14-byte reports has the reversed quadrature table of the one with 8.

    Args:
        encoder: direction of each encoder A, B, C.
        motor: direction of each motor.
        home_counts: what the encoders would read in the home pose if their zero were that of the angles.
        source: the host program that these signs were read in.
        gimbal: direction of each sensor of the gimbal.
        gimbal_home_counts: as `home_counts`.
    """

    encoder: Signs
    motor: Signs
    home_counts: Counts
    source: str
    gimbal: Signs = (1, 1, 1)
    gimbal_home_counts: Counts = (0, 0, 0)


@dataclass(frozen=True)
class Parameters:
    """A mechanism with what its makers say of it.

    Args:
        name: of the set.
        mechanism: with the signs of the first of `wirings`.
        wirings: the published signs, by board.
        force_n: largest force [N].
        stiffness_n_m: stiffest spring that it shows stably [N/m].
        damping_n_s_m: strongest damper [N s/m].
        radius_m: of the workspace about its middle [m].
        source: where all this was read.
        warnings: what to know before it is believed.
        gimbal_reversed_over_hid: whether the gimbal's counters come last to first on the boards that speak HID.
    """

    name: str
    mechanism: Mechanism
    wirings: Mapping[Board, Wiring]
    force_n: float
    stiffness_n_m: float
    damping_n_s_m: float
    radius_m: float
    source: str
    warnings: tuple[str, ...] = ()
    gimbal_reversed_over_hid: bool = False

    @property
    def reach_m(self) -> float:
        """Farthest from the middle along any axis that the handle can credibly be [m]: its home pose is there."""
        home = self.mechanism.position((0, 0, 0))
        return max(2.0 * self.radius_m, max(map(abs, home)) + BEYOND_HOME_M)

    def without_gimbal(self) -> "Parameters":
        drive = replace(self.mechanism.drive, gimbal_counts_per_turn=(0, 0, 0))
        return self._driven(drive)

    def on(self, board: Board) -> "Parameters":
        """With the signs published for a board; KeyError where there are none."""
        return self.wired(self.wirings[board])

    def wired(self, wiring: Wiring) -> "Parameters":
        drive = replace(
            self.mechanism.drive,
            encoder_directions=wiring.encoder,
            motor_directions=wiring.motor,
            home_counts=wiring.home_counts,
            gimbal_directions=wiring.gimbal,
            gimbal_home_counts=wiring.gimbal_home_counts,
        )
        return self._driven(drive)

    def _driven(self, drive: Drive) -> "Parameters":
        return replace(self, mechanism=replace(self.mechanism, drive=drive))


def _mechanism(
    linkage: SerialParallelogram | FiveBar,
    drive: tuple[Triple, Triple, Counts, Triple],
    wirings: Mapping[Board, Wiring],
    gimbal_counts_per_turn: Counts = (0, 0, 0),
    gimbal_axes: str = "xyx",
    weight: Weight | None = None,
) -> Mechanism:
    """With the first of the wirings; `drive` is capstans [m], bodies [m], counts per turn, and torque constants."""
    capstan_m, body_m, counts_per_turn, torque_constant = drive
    wiring = next(iter(wirings.values()))
    return Mechanism(
        Drive(
            capstan_m,
            body_m,
            counts_per_turn,
            wiring.encoder,
            wiring.motor,
            wiring.home_counts,
            torque_constant,
            gimbal_counts_per_turn,
            wiring.gimbal,
            wiring.gimbal_home_counts,
        ),
        linkage,
        gimbal_axes,
        weight,
    )


def _woodenhaptics(
    name: str, torque_constants: Triple, wirings: Mapping[Board, Wiring], source: str, warnings: tuple[str, ...] = ()
) -> Parameters:
    return Parameters(
        name,
        _mechanism(
            SerialParallelogram(0.080, 0.205, 0.245, (0.220, 0.0, 0.080)),
            ((0.010, 0.010, 0.010), (0.160, 0.120, 0.120), (2000, 2000, 2000), torque_constants),
            wirings,
            weight=ParallelogramWeight(0.170, 0.110, 0.051, 0.091, lb=0.205),
        ),
        wirings,
        force_n=5.0,
        stiffness_n_m=1000.0,
        damping_n_s_m=8.0,
        radius_m=0.1,
        source=source,
        warnings=warnings,
    )


# Signs as a host with flags `motor_and_body_aligned` has them, +1 for 0 and -1 for 1, for its encoders and its motors.
_PLUS: Signs = (1, 1, 1)
_MINUS: Signs = (-1, -1, -1)
_PLUS_MINUS_MINUS: Signs = (1, -1, -1)

WOODENHAPTICS_2015 = _woodenhaptics(
    "woodenhaptics_2015",
    (0.0259, 0.0259, 0.0259),
    {
        "serial": Wiring(_PLUS_MINUS_MINUS, _PLUS_MINUS_MINUS, (0, 0, -6000), HFABAPI),
        "hid14": Wiring(_PLUS, _PLUS, (0, 0, 6000), HAPTIKFABRIKENAPI),
        # The 8-byte branch of haptikfabrikenapi has the same encoders, but +, +, + for the motors.
        "hid8": Wiring(_MINUS, _PLUS_MINUS_MINUS, (0, 0, -6000), WOODY_EXPERIMENTAL),
    },
    f"{HFABAPI}; {HAPTIKFABRIKENAPI}; {WOODY_EXPERIMENTAL}",
)

WOODENHAPTICS_2019 = _woodenhaptics(
    "woodenhaptics_2019",
    (0.321, 0.0603, 0.0603),
    {
        "serial": Wiring(_PLUS, _PLUS, (0, 0, 6000), HFABAPI),
        "hid14": Wiring(_PLUS, _PLUS, (0, 0, 6000), HFABAPI),
    },
    HFABAPI,
    ("motor A has 12 times the torque constant of woodenhaptics_2015: the wrong set is a wrong force on A",),
)

_ALUHAPTICS: Mapping[Board, Wiring] = {
    "hid8": Wiring((1, -1, 1), (1, -1, 1), (0, -3878, 0), WOODY_EXPERIMENTAL),
}

ALUHAPTICS_V2 = Parameters(
    "aluhaptics_v2",
    _mechanism(
        SerialParallelogram(0.111, 0.140, 0.111, (0.140, 0.0, 0.0)),
        ((0.0138, 0.0098, 0.0098), (0.116, 0.076, 0.076), (2000, 2000, 2000), (0.0259, 0.0259, 0.0259)),
        _ALUHAPTICS,
    ),
    _ALUHAPTICS,
    force_n=5.0,
    stiffness_n_m=1000.0,
    damping_n_s_m=8.0,
    radius_m=0.1,
    source=f"{HFABAPI}; {HAPTIKFABRIKENAPI}; signs and home pose: {WOODY_EXPERIMENTAL} with ALUHAPTICS",
    warnings=("the newer hosts name a home pose for it with the arm folded, which cannot be meant",),
)

_VINTAGE: Mapping[Board, Wiring] = {
    # Roll: getRot of the live API does not use the flag of the sixth encoder, the others are by their flags.
    "serial": Wiring((-1, 1, -1), (-1, 1, -1), (0, 7700, 0), HFABAPI, gimbal=(-1, 1, 1)),
}

VINTAGE_PHANTOM = Parameters(
    "vintage_phantom",
    _mechanism(
        SerialParallelogram(0.0, 0.138, 0.112, (0.138, 0.0, -0.097)),
        ((0.013, 0.010, 0.010), (0.117, 0.077, 0.077), (4000, 4000, 4000), (0.0234, 0.0234, 0.0234)),
        _VINTAGE,
        (2000, 2000, 2000),
        "zyx",
    ),
    _VINTAGE,
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

_VINTAGE_2021: Mapping[Board, Wiring] = {"hid14": Wiring(_PLUS, _PLUS, (0, 7700, 0), HAPTIKFABRIKENAPI)}

VINTAGE_PHANTOM_2021 = Parameters(
    "vintage_phantom_2021",
    _mechanism(
        SerialParallelogram(0.056, 0.138, 0.112, (0.140, 0.0, 0.0)),
        ((0.013, 0.010, 0.010), (0.117, 0.077, 0.077), (4000, 4000, 4000), (0.0163, 0.0163, 0.0163)),
        _VINTAGE_2021,
    ),
    _VINTAGE_2021,
    force_n=5.0,
    stiffness_n_m=800.0,
    damping_n_s_m=8.0,
    radius_m=0.1,
    source=HAPTIKFABRIKENAPI,
    warnings=("its source names no home pose: that of vintage_phantom is taken",),
)


def _polhem(encoder: Signs, home: Counts, gimbal: Signs, gimbal_home: Counts) -> Mapping[Board, Wiring]:
    """The host of the Polhem takes the counts of either board as they are; only roll has another sign.

    The live API of 2026 rolls by +count whatever the flag says (hfab_api.cpp, getRot), that of 2021 by the flag
    (kinematics.cpp, computeRotation).
    """
    d, e, f = gimbal
    return {
        "serial": Wiring(encoder, encoder, home, HFABAPI, (d, e, 1), gimbal_home),
        "hid14": Wiring(encoder, encoder, home, HAPTIKFABRIKENAPI, (d, e, f), gimbal_home),
    }


_POLHEM_V1 = _polhem(_MINUS, (0, 0, -5000), (-1, 1, -1), (0, 0, 0))

POLHEM_V1 = Parameters(
    "polhem_v1",
    _mechanism(
        SerialParallelogram(0.058, 0.174, 0.133, (0.140, 0.0, 0.100)),
        ((0.010, 0.010, 0.010), (0.180, 0.100, 0.100), (2000, 2000, 2000), (0.0538, 0.0538, 0.0538)),
        _POLHEM_V1,
        (1024, 1024, 1024),
        weight=ParallelogramWeight(0.080, 0.080, 0.040, 0.070, lb=0.174),
    ),
    _POLHEM_V1,
    force_n=5.0,
    stiffness_n_m=800.0,
    damping_n_s_m=8.0,
    radius_m=0.1,
    source=f"{HFABAPI}; {HAPTIKFABRIKENAPI}",
    gimbal_reversed_over_hid=True,
)


def _five_bar(origin: tuple[float, float, float]) -> tuple[FiveBar, FiveBarWeight]:
    """The linkage of the newer Polhem and the weight of its links with covers (hfab_polhem.h, 2019-04-12)."""
    linkage = FiveBar(0.034, 0.165, 0.025, 0.190, 0.034, 0.1308, origin)
    return linkage, FiveBarWeight(
        linkage,
        upper_arm=Link(0.15764, 0.030123, 0.000484),
        crank=Link(0.07733, -0.004086, 0.001911),
        coupler=Link(0.09767, 0.087765, 0.001978),
        forearm=Link(0.11265, 0.061701, 0.000576),
    )


_V2_LINKAGE, _V2_WEIGHT = _five_bar((0.137, 0.0, 0.0))
_POLHEM_V2 = _polhem((1, -1, 1), (8327, -10926, 27140), _MINUS, (0, 30, 0))

POLHEM_V2 = Parameters(
    "polhem_v2",
    _mechanism(
        _V2_LINKAGE,
        ((0.0288, 0.0130, 0.010), (0.175, 0.100, 0.100), (4096, 4096, 4096), (0.321, 0.0538, 0.0538)),
        _POLHEM_V2,
        (1024, 1024, 1024),
        weight=_V2_WEIGHT,
    ),
    _POLHEM_V2,
    force_n=5.0,
    stiffness_n_m=2000.0,
    damping_n_s_m=1.0,
    radius_m=0.15,
    source=f"{HAPTIKFABRIKENAPI}, where polhem_v3 has these numbers too",
    warnings=("motor A has 5 times the torque constant of polhem_v3: the wrong set is a wrong force on A",),
    gimbal_reversed_over_hid=True,
)

_V3_LINKAGE, _V3_WEIGHT = _five_bar((0.2045, 0.0, 0.0325))
_POLHEM_V3 = _polhem((1, -1, 1), (8312, -10366, 19764), _MINUS, (0, 30, 0))

POLHEM_V3 = Parameters(
    "polhem_v3",
    _mechanism(
        _V3_LINKAGE,
        ((0.0288534, 0.0136981, 0.0137281), (0.175, 0.100, 0.100), (4096, 4096, 4096), (0.0603, 0.0538, 0.0538)),
        _POLHEM_V3,
        (1024, 1024, 1024),
        weight=_V3_WEIGHT,
    ),
    _POLHEM_V3,
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
