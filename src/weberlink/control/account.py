"""The energy that one display may still give: the passivity observer of the hand and the bound of what is displayed.

An account E begins with an allowance, gains the work of the hand, loses what is given to it, and is refilled up to the
allowance, with a constant power and with what a light damper would take from the hand. What the scene gave beyond what
it took, as measured at the robot, is added (credit). What is displayed is at most

    |F| <= sqrt(2 k E),

the force at which a spring of the stiffness k of the contact stores E. As the hand is pushed out, the bound falls like
the force of that spring, so nothing is switched. In any time t the hand gets at most

    allowance + refill t + damping (integral of v^2 dt) + credit + the work of one tick                            [J]

more than it gave, whatever delay, loss, jitter, codec, model and scene are: E never exceeds the allowance by more than
what was put in and not taken out, and at E <= 0 nothing is displayed. The proof is in docs/control.md. Sources:

- Hannaford, Ryu, "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics and Automation 18(1), 2002,
  and Ryu, Kwon, Hannaford, "Stable teleoperation with time-domain passivity control", IEEE Trans. Robotics and
  Automation 20(2), 2004: the exact work of a held force, and its observer.
- Franken, Stramigioli, Misra, Secchi, Macchelli, "Bilateral telemanipulation with time delays: a two-layer approach
  combining passivity and transparency", IEEE Trans. Robotics 27(4), 2011: a budget of energy below a free choice of
  what is displayed, which saturates it.
- Colgate, Schenkel, "Passivity of a class of sampled-data systems", J. Robotic Systems 14(1), 1997: the damping of a
  hand pays for sampling and holding.
"""

from math import inf, sqrt

from weberlink.control.contract import AccountParameters

RETURN = 0.5
"""Power with which what an interruption took returns [W]."""


class Account:
    """The account of one display; `energy` is E [J], below 0 by the work of one tick at most."""

    __slots__ = ("_allowance", "_damping", "_refill", "_reserve", "_rise", "_taken", "energy")

    def __init__(self, parameters: AccountParameters) -> None:
        self._allowance = parameters.allowance
        self._refill, self._damping, self._rise = parameters.refill, parameters.damping, parameters.rise
        self.reset()

    def reset(self) -> None:
        """Begin a session, with the allowance."""
        self.energy = self._reserve = self._allowance
        self._taken = 0.0

    def resume(self) -> None:
        """Begin anew within a session, with nothing; a debt stays. What there was returns with a limited power.

        So no interruption adds to the bound, and none takes for long what the hand has put in.
        """
        self._taken += max(0.0, self.energy)
        self.energy = min(self.energy, 0.0)
        self._reserve = 0.0

    def book(self, given: float, moved: float, elapsed: float, supplied: float = 0.0) -> None:
        """Take in a tick.

        Args:
            given: to the hand [J].
            moved: square of the way of the hand [m^2].
            elapsed: duration [s].
            supplied: by the scene, beyond what it took [J].
        """
        if self._taken > 0.0:
            back = min(self._taken, RETURN * elapsed)
            self._taken -= back
            supplied += back
        self.energy += supplied - given
        self._reserve += supplied  # it comes in lumps
        full = self._allowance - self._taken
        if self.energy < full and elapsed > 0.0:
            filled = self.energy + self._refill * elapsed + self._damping * moved / elapsed
            self.energy = filled if filled < full else full

    def share(self, force: float, stiffness: float, elapsed: float, softest: float = inf) -> float:
        """The share of a force of this size [N], of a contact of this stiffness [N/m], that may be displayed, 0..1.

        E is at most the allowance and what a spring stores at this force: of this stiffness, or of the softer one that
        the contact may have, `softest` [N/m].

        The part that the hand has not pressed in itself rises with a limited rate: a wall that is felt late rises, and
        does not kick the hand.
        """
        stored = 0.5 * force * force / stiffness
        softer = softest if softest < stiffness else stiffness
        most = self._allowance + 0.5 * force * force / softer  # what friction and damping took is not kept
        if self.energy + self._taken > most:
            self.energy = min(self.energy, most)
            self._taken = most - self.energy
        energy = self.energy
        if stored == 0.0:
            self._reserve = energy if energy > 0.0 else 0.0
            return 1.0
        pressed = energy - self._reserve
        reach = sqrt(2.0 * stiffness * (pressed if pressed > 0.0 else 0.0)) + self._rise * elapsed
        free = 0.5 * reach * reach / stiffness
        free = free if free < energy else energy
        self._reserve = energy - free if energy > free else 0.0
        if stored <= free:
            return 1.0
        return sqrt(free / stored) if free > 0.0 else 0.0


def passivity_limit(
    damping: float, tick_period: float, *, delay_ticks: float = 0.0, wall_damping: float = 0.0
) -> float:
    """The stiffness [N/m] up to which a sampled wall and the device that displays it are passive; may be 0.

    b > K (T/2 + t) + |B| with the delay t; for t = 0 it is the bound of Colgate and Schenkel, "Passivity of a class of
    sampled-data systems: application to haptic interfaces", ACC 1994. From their criterion for any law, delay and
    damping are each taken at their worst frequency, so with both the bound is on the safe side.

    Args:
        damping: b, of device and hand [N s/m], >= 0.
        tick_period: T [s], > 0.
        delay_ticks: t in ticks, from the sampling of a position to the force that answers it, >= 0.
        wall_damping: B [N s/m].
    """
    return max(0.0, (damping - abs(wall_damping)) / (tick_period * (0.5 + delay_ticks)))
