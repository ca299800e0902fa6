"""How the emulated devices are wired: as a published host program expects them.

Every entry uses the terms of its source (flags, calibration counts) and is independent of the tables of the drivers, so
a driver with a wrong sign shows a wrong position or force.

- `hfabapi` (forsslund/hfabapi, 2026-06-10, serial): configurations in hfab_math.h, home counts in hfab_api.cpp.
- `haptikfabrikenapi` (forsslund/haptikfabrikenapi, 2021-06-10): configurations in haptikfabrikenapi.h; its USB thread
  takes the counts of 14-byte boards as they are, and negates those of 8-byte boards.
- `woody_experimental` (WoodenHaptics/woody-experimental, 8 bytes): CWoodenDevice.cpp, getPosition and
  setForceAndTorqueAndGripperForce.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, tau
from typing import Literal, get_args

from weberlink.master.devices.polhem.mechanism import CableDrive, Counts, Signs, Triple, Wiring
from weberlink.master.devices.polhem.parameters import Board

Host = Literal["hfabapi", "haptikfabrikenapi", "woody_experimental"]


@dataclass(frozen=True)
class HostWiring:
    """A device as a host expects it.

    angle = encoder * (2 pi count / N) c / b + zero, and torque on the body = motor * torque of the motor * b / c.

    Args:
        encoder: sign of each encoder.
        motor: sign of each motor.
        zero_counts: counts that the host adds, before it multiplies by the sign of the motor.
        zero_rad: angles that the host adds [rad].
        gimbal: sign of each sensor of the gimbal.
        gimbal_zero: counts that the host adds to them.
    """

    encoder: Signs
    motor: Signs
    zero_counts: Counts = (0, 0, 0)
    zero_rad: Triple = (0.0, 0.0, 0.0)
    gimbal: Signs = (1, 1, 1)
    gimbal_zero: Counts = (0, 0, 0)

    def on(self, drive: CableDrive) -> Wiring:
        """The wiring of a drive with these signs, at 0 counts in the home pose."""
        home = []
        for axis in range(3):
            per_count = tau / drive.counts_per_turn[axis] * drive.capstan_m[axis] / drive.body_m[axis]
            angle = self.motor[axis] * self.zero_counts[axis] * per_count + self.zero_rad[axis]
            home.append(round(angle / (self.encoder[axis] * per_count)))
        a, b, c = home
        return Wiring(self.encoder, self.motor, (a, b, c), self.gimbal, self.gimbal_zero)


def _flagged(
    flags: Counts,
    zero: Counts = (0, 0, 0),
    gimbal: Signs = (1, 1, 1),
    gimbal_zero: Counts = (0, 0, 0),
    *,
    negated: bool = False,
) -> HostWiring:
    """From the flags `motor_and_body_aligned` of the newer hosts; `negated` if the host negates the counts."""
    a, b, c = (-1 if flag else 1 for flag in flags)
    return HostWiring((-a, -b, -c) if negated else (a, b, c), (a, b, c), zero, gimbal=gimbal, gimbal_zero=gimbal_zero)


HOST_WIRINGS: Mapping[tuple[Host, Board], Mapping[str, HostWiring]] = {
    ("hfabapi", "serial"): {
        "woodenhaptics_2015": _flagged((0, 1, 1), (0, 0, -6000)),
        "woodenhaptics_2019": _flagged((0, 0, 0), (0, 0, 6000)),
        # getRot: roll is +count, the other two by enc_and_body_aligned (+ where it is set).
        "vintage_phantom": _flagged((1, 0, 1), (0, 7700, 0), (-1, 1, 1)),
        "polhem_v1": _flagged((1, 1, 1), (0, 0, -5000), (-1, 1, 1)),
        "polhem_v2": _flagged((0, 1, 0), (8327, -10926, 27140), (-1, -1, 1), (0, 30, 0)),
        "polhem_v3": _flagged((0, 1, 0), (8312, -10366, 19764), (-1, -1, 1), (0, 30, 0)),
    },
    ("haptikfabrikenapi", "hid14"): {
        "woodenhaptics_2015": _flagged((0, 0, 0), (0, 0, 6000)),
        "woodenhaptics_2019": _flagged((0, 0, 0), (0, 0, 6000)),  # the configuration is in hfab_math.h
        "vintage_phantom_2021": _flagged((0, 0, 0), (0, 7700, 0)),  # home pose of vintage_phantom: it names none
        # computeRotation: all three by their flags.
        "polhem_v1": _flagged((1, 1, 1), (0, 0, -5000), (-1, 1, -1)),
        "polhem_v2": _flagged((0, 1, 0), (8327, -10926, 27140), (-1, -1, -1), (0, 30, 0)),
        "polhem_v3": _flagged((0, 1, 0), (8312, -10366, 19764), (-1, -1, -1), (0, 30, 0)),
    },
    ("haptikfabrikenapi", "hid8"): {"woodenhaptics_2015": _flagged((0, 0, 0), (0, 0, 6000), negated=True)},
    ("woody_experimental", "hid8"): {
        # tA = -a, tB = -b, tC = pi/2 - c; currents +A, -B, -C.
        "woodenhaptics_2015": HostWiring((-1, -1, -1), (1, -1, -1), zero_rad=(0.0, 0.0, 0.5 * pi)),
        # With ALUHAPTICS: tA = +a, tB = pi/2 - b, tC = +c; currents +A, -B, +C.
        "aluhaptics_v2": HostWiring((1, -1, 1), (1, -1, 1), zero_rad=(0.0, 0.5 * pi, 0.0)),
    },
}

HOSTS: Mapping[Board, Host] = {"serial": "hfabapi", "hid14": "haptikfabrikenapi", "hid8": "woody_experimental"}
"""The default host for each board."""


def host_wiring(name: str, wire: Board, host: Host | None = None) -> HostWiring:
    """How a device with a set of parameters is wired on a kind of board.

    Raises:
        ValueError: no host is published for that.
    """
    expected = host or HOSTS[wire]
    found = HOST_WIRINGS.get((expected, wire), {}).get(name)
    if found is None:
        known = [
            f"{each} for {', '.join(HOST_WIRINGS[each, wire])}"
            for each in get_args(Host)
            if (each, wire) in HOST_WIRINGS
        ]
        raise ValueError(f"parameters: {expected} drives no {name} over {wire}; published are {'; '.join(known)}")
    return found
