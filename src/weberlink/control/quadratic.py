"""The share of a change that an energy can pay for, where the cost has a linear and a quadratic part."""

from math import inf, sqrt


def root_share(linear: float, square: float, energy: float) -> float:
    """The largest s with  s linear + s^2 square <= energy, by the formula without cancellation; inf if there is none.

    Args:
        linear: cost of the whole change at the present rate [J]; negative if it pays.
        square: additional cost of the whole change, as its rate grows with the change [J], >= 0; may be infinite.
        energy: to pay with [J], >= 0.
    """
    if square == inf:
        return 0.0
    if square == 0.0:
        return energy / linear if linear > 0.0 else inf
    root = sqrt(linear * linear + 4.0 * square * energy)
    return 2.0 * energy / (linear + root) if linear > 0.0 else 0.5 * (root - linear) / square
