"""Energy-bounded display of torques: of the joints of an arm, and of a handle.

All axes share one account. Angles and torques come to it by a lever r, as ways r q and forces tau / r; their work does
not depend on the lever. What is displayed is the decoded torque, as far as the account pays for it: no model of a
contact is fitted to torques.
"""

from math import hypot

from weberlink.control.account import Account
from weberlink.control.contract import AccountParameters, AxesMaster
from weberlink.geometry.joints import Joints

LEVER = 0.2
"""Distance from the joints of a desktop arm to the hand that leads it, roughly [m]."""
HANDLE = 0.05
"""Distance from the axes of a handle to the fingers that turn it, roughly [m]."""
STIFFNESS = 2500.0
"""Stiffness of a contact at the lever, where none is known [N/m]."""


class BoundedAxes(AxesMaster):
    """Displays the decoded torques within the account.

    Args:
        lever: distance from an axis at which forces and speeds are those of a hand [m], > 0.
        account: of the hand.
    """

    def __init__(self, lever: float, account: AccountParameters) -> None:
        self._lever = lever
        self._account = Account(account)
        self._forget()

    def reset(self) -> None:
        self._account.reset()
        self._forget()

    def resume(self, peer_credit: int) -> None:  # noqa: ARG002
        self._account.resume()
        self._forget()

    def _forget(self) -> None:
        self._position: Joints | None = None
        self._held: Joints = ()
        self._elapsed = 0.0

    @property
    def energy(self) -> float:
        return self._account.energy

    def observe(self, position: Joints, elapsed: float, tick: float, peer_credit: int, rtt: float | None) -> None:  # noqa: ARG002
        before, self._position, self._elapsed = self._position, position, elapsed
        if before is None or not self._held:
            return
        given = moved = 0.0
        for now, then, torque in zip(position, before, self._held, strict=True):
            given += torque * (now - then)
            moved += (now - then) ** 2
        self._account.book(given, moved * self._lever**2, elapsed)

    def render(self, torque: Joints) -> Joints:
        share = self._account.share(hypot(*torque) / self._lever, STIFFNESS, self._elapsed)
        return torque if share == 1.0 else tuple([share * value for value in torque])

    def displayed(self, torque: Joints) -> None:
        self._held = torque


def build_axes(scheme: str, lever: float, account: AccountParameters) -> AxesMaster:
    """The operator's end of a scheme for axes that turn: bounded, unless the scheme is `none`."""
    return AxesMaster() if scheme == "none" else BoundedAxes(lever, account)
