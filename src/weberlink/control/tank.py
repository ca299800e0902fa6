"""A store of energy that a port may spend, and what it has handed to the store at the other end.

The two stores and what travels between them are all the energy that the link holds, so while neither is negative the
link has given out no more than it took in (Franken, Stramigioli, Misra, Secchi, Macchelli, "Bilateral telemanipulation
with time delays: a two-layer approach combining passivity and transparency", IEEE Trans. Robotics 27(4), 2011). What
travels are sums since the session began, as in the time-domain passivity approach for networks (Artigas, Ryu, Preusche,
Hirzinger, "Network representation and passivity of delayed teleoperation systems", IROS 2011): a lost datagram delays
energy and never makes or destroys it.
"""

from weberlink.control.contract import CREDIT_STEP

FORGIVENESS = 10.0
"""Time constant with which a debt is forgotten that was made while nothing was controlled [s]."""


class EnergyTank:
    """Energy [J] of one side. Its level may fall below 0 by what a tick took that was foreseen to take less."""

    __slots__ = ("_handed", "_received", "level", "spilled")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.level = 0.0
        self.spilled = 0.0
        """Energy given up for good, which no one may spend any more."""
        self._handed = 0.0
        self._received = 0

    @property
    def credit(self) -> int:
        """Handed over so far, in whole units."""
        return int(self._handed / CREDIT_STEP)

    def receive(self, credit: int) -> None:
        """Take in what the other side has handed over by now, in units since the session began."""
        if credit > self._received:
            self.level += (credit - self._received) * CREDIT_STEP
            self._received = credit

    def renounce(self, credit: int) -> None:
        """Give up what there is to spend, and what the other side has handed over by now; a debt stays."""
        self.receive(credit)
        self.spill(0.0)

    def hand_over(self, energy: float) -> None:
        """Give energy to the other side; a negative amount gives none."""
        if energy > 0.0:
            self.level -= energy
            self._handed += energy

    def spill(self, cap: float) -> None:
        """Give up what is above the cap: a credit without bound would hide activity for as long as it lasts."""
        if self.level > cap:
            self.spilled += self.level - cap
            self.level = cap

    def forgive(self, share: float) -> None:
        """Give up this share of a debt, 0..1: of a time in which nobody kept to the level."""
        if self.level < 0.0:
            given = self.level * min(1.0, share)
            self.spilled += given
            self.level -= given
