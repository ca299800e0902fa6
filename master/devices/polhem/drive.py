"""Encoder counts and motor currents on one side, the angles and torques of the three driven bodies on the other.

Each body is turned by its motor through a cable on a capstan. Knows no linkage: what the bodies move is not known here.
"""

from dataclasses import dataclass
from math import tau

Angles = tuple[float, float, float]
"""Of the bodies A, B and C [rad]."""

Counts = tuple[int, int, int]
"""Of the encoders on the motors A, B and C, relative to the home pose."""

Triple = tuple[float, float, float]
Signs = tuple[int, int, int]

MA_PER_A = 1e3


@dataclass(frozen=True)
class Drive:
    """angle_i = e_i 2 pi (count_i + home_i) / N_i c_i / b_i, and I_i = m_i torque_i c_i / b_i / Kt_i.

    The signs e and m are independent: e depends on the encoder's wiring and the firmware's counting table, m on the
    motor's wiring and the amplifier.

    Args:
        capstan_m: diameters c on the motors [m].
        body_m: diameters b on the bodies [m].
        counts_per_turn: N of a motor, all edges counted.
        encoder_directions: e, each +1 or -1.
        motor_directions: m, each +1 or -1.
        home_counts: what the encoders would read in the home pose if their zero were that of the angles.
        torque_constant_n_m_a: Kt of the motors [N m/A].
        gimbal_counts_per_turn: of the sensors of the handle's orientation, in the order of their axes; 0 for none.
        gimbal_directions: each +1 or -1.
        gimbal_home_counts: as `home_counts`.
    """

    capstan_m: Triple
    body_m: Triple
    counts_per_turn: Counts
    encoder_directions: Signs
    motor_directions: Signs
    home_counts: Counts
    torque_constant_n_m_a: Triple
    gimbal_counts_per_turn: Counts = (0, 0, 0)
    gimbal_directions: Signs = (1, 1, 1)
    gimbal_home_counts: Counts = (0, 0, 0)

    def __post_init__(self) -> None:
        ratios = [c / b for c, b in zip(self.capstan_m, self.body_m, strict=True)]
        a, b, c = (
            d * tau / n * ratio
            for d, n, ratio in zip(self.encoder_directions, self.counts_per_turn, ratios, strict=True)
        )
        object.__setattr__(self, "_per_count", (a, b, c))
        a, b, c = (
            d * ratio / constant * MA_PER_A
            for d, ratio, constant in zip(self.motor_directions, ratios, self.torque_constant_n_m_a, strict=True)
        )
        object.__setattr__(self, "_ma_per_n_m", (a, b, c))

    @property
    def radians_per_count(self) -> Triple:
        """Of the bodies; negative where the encoder's direction is."""
        per_count: Triple = self._per_count  # type: ignore[attr-defined]
        return per_count

    @property
    def ma_per_n_m(self) -> Triple:
        """Current for a torque on the body [mA/(N m)]; negative where the motor's direction is."""
        ma_per_n_m: Triple = self._ma_per_n_m  # type: ignore[attr-defined]
        return ma_per_n_m

    def angles(self, counts: Counts) -> Angles:
        (a, b, c), (home_a, home_b, home_c) = self.radians_per_count, self.home_counts
        return (a * (counts[0] + home_a), b * (counts[1] + home_b), c * (counts[2] + home_c))

    def counts(self, angles: Angles) -> Counts:
        """The nearest ones."""
        (a, b, c), (home_a, home_b, home_c) = self.radians_per_count, self.home_counts
        return (round(angles[0] / a) - home_a, round(angles[1] / b) - home_b, round(angles[2] / c) - home_c)

    def currents_ma(self, torques: Triple) -> Triple:
        """Motor currents [mA] for torques on the bodies [N m]."""
        a, b, c = self.ma_per_n_m
        return (a * torques[0], b * torques[1], c * torques[2])

    def torques(self, currents_ma: Triple) -> Triple:
        """Torques on the bodies [N m] of motor currents [mA]."""
        a, b, c = self.ma_per_n_m
        return (currents_ma[0] / a, currents_ma[1] / b, currents_ma[2] / c)

    def gimbal(self, counts: Counts) -> Angles | None:
        """The angles of the gimbal [rad]; None unless it has all three sensors."""
        if 0 in self.gimbal_counts_per_turn:
            return None
        first, second, third = (
            d * (count + home) * tau / per_turn
            for d, count, home, per_turn in zip(
                self.gimbal_directions, counts, self.gimbal_home_counts, self.gimbal_counts_per_turn, strict=True
            )
        )
        return (first, second, third)
