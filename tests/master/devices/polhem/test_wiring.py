"""Signs and home counts of the Polhem boards: those of the published hosts.

The table uses the terms of its sources (flags, calibration counts) and is independent of `parameters.yaml`:

- `hfabapi` (forsslund/hfabapi, 2026-06-10, serial): configurations in hfab_math.h, home counts in hfab_api.cpp.
- `haptikfabrikenapi` (forsslund/haptikfabrikenapi, 2021-06-10): configurations in haptikfabrikenapi.h; its USB thread
  takes the counts of 14-byte boards as they are, and negates those of 8-byte boards.
- `woody_experimental` (WoodenHaptics/woody-experimental, 8 bytes): CWoodenDevice.cpp, getPosition and
  setForceAndTorqueAndGripperForce.
"""

from math import pi, tau
from typing import NamedTuple

from weberlink.master.devices.polhem.mechanism import Board, Counts, Signs, Triple, Wiring
from weberlink.master.devices.polhem.parameters import PARAMETERS


class Host(NamedTuple):
    """angle = encoder * (2 pi count / N) c / b + zero, and torque on the body = motor * torque of the motor * b / c.

    `zero_counts` are added before the host multiplies by the sign of the motor, `zero_rad` afterwards.
    """

    encoder: Signs
    motor: Signs
    zero_counts: Counts = (0, 0, 0)
    zero_rad: Triple = (0.0, 0.0, 0.0)
    gimbal: Signs = (1, 1, 1)
    gimbal_zero: Counts = (0, 0, 0)


def flagged(
    flags: str, zero: Counts, gimbal: Signs = (1, 1, 1), gimbal_zero: Counts = (0, 0, 0), sign: int = 1
) -> Host:
    """From the flags `motor_and_body_aligned` of the newer hosts, which may multiply the counts by a `sign`."""
    a, b, c = (-1 if flag == "1" else 1 for flag in flags)
    return Host((sign * a, sign * b, sign * c), (a, b, c), zero, gimbal=gimbal, gimbal_zero=gimbal_zero)


PUBLISHED: dict[tuple[str, Board, str], Host] = {
    ("hfabapi", "serial", "woodenhaptics_2015"): flagged("011", (0, 0, -6000)),
    ("hfabapi", "serial", "woodenhaptics_2019"): flagged("000", (0, 0, 6000)),
    # getRot: roll is +count, the other two by enc_and_body_aligned (+ where it is set).
    ("hfabapi", "serial", "vintage_phantom"): flagged("101", (0, 7700, 0), (-1, 1, 1)),
    ("hfabapi", "serial", "polhem_v1"): flagged("111", (0, 0, -5000), (-1, 1, 1)),
    ("hfabapi", "serial", "polhem_v2"): flagged("010", (8327, -10926, 27140), (-1, -1, 1), (0, 30, 0)),
    ("hfabapi", "serial", "polhem_v3"): flagged("010", (8312, -10366, 19764), (-1, -1, 1), (0, 30, 0)),
    ("haptikfabrikenapi", "hid14", "woodenhaptics_2015"): flagged("000", (0, 0, 6000)),
    # The configuration is in hfab_math.h.
    ("haptikfabrikenapi", "hid14", "woodenhaptics_2019"): flagged("000", (0, 0, 6000)),
    # The home pose is that of vintage_phantom: it names none.
    ("haptikfabrikenapi", "hid14", "vintage_phantom_2021"): flagged("000", (0, 7700, 0)),
    # computeRotation: all three by their flags.
    ("haptikfabrikenapi", "hid14", "polhem_v1"): flagged("111", (0, 0, -5000), (-1, 1, -1)),
    ("haptikfabrikenapi", "hid14", "polhem_v2"): flagged("010", (8327, -10926, 27140), (-1, -1, -1), (0, 30, 0)),
    ("haptikfabrikenapi", "hid14", "polhem_v3"): flagged("010", (8312, -10366, 19764), (-1, -1, -1), (0, 30, 0)),
    ("haptikfabrikenapi", "hid8", "woodenhaptics_2015"): flagged("000", (0, 0, 6000), sign=-1),
    # tA = -a, tB = -b, tC = pi/2 - c; currents +A, -B, -C.
    ("woody_experimental", "hid8", "woodenhaptics_2015"): Host((-1, -1, -1), (1, -1, -1), zero_rad=(0, 0, 0.5 * pi)),
    # With ALUHAPTICS: tA = +a, tB = pi/2 - b, tC = +c; currents +A, -B, +C.
    ("woody_experimental", "hid8", "aluhaptics_v2"): Host((1, -1, 1), (1, -1, 1), zero_rad=(0, 0.5 * pi, 0)),
}


def test_signs_and_home_counts_are_those_of_the_hosts() -> None:
    for (name_of_host, board, name), host in PUBLISHED.items():
        drive, home = PARAMETERS[name], list[int]()
        for axis in range(3):
            per_count = tau / drive.counts_per_turn[axis] * drive.capstan_m[axis] / drive.body_m[axis]
            angle = host.motor[axis] * host.zero_counts[axis] * per_count + host.zero_rad[axis]
            home.append(round(angle / (host.encoder[axis] * per_count)))
        a, b, c = home
        # Of the two hosts of the 8-byte board, the motors of the other count.
        motor = (1, -1, -1) if (name_of_host, board) == ("haptikfabrikenapi", "hid8") else host.motor
        expected = Wiring(host.encoder, motor, (a, b, c), host.gimbal, host.gimbal_zero)
        assert PARAMETERS[name].wirings[board] == expected, (name_of_host, board, name)
    assert {(board, name) for _, board, name in PUBLISHED} == {
        (board, name) for name, mechanism in PARAMETERS.items() for board in mechanism.wirings
    }
