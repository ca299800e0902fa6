"""How stiff a sampled wall may be on a damped device without giving energy to the hand."""


def passivity_limit(
    damping: float, tick_period: float, *, delay_ticks: float = 0.0, wall_damping: float = 0.0
) -> float:
    """The stiffness [N/m] up to which a sampled wall and the device that displays it are passive; may be 0.

    b > K (T/2 + t) + |B| with the delay t. For t = 0 it is the bound of Colgate and Schenkel, "Passivity of a class of
    sampled-data systems: application to haptic interfaces", ACC 1994. Their criterion for any law H,

        b > T/2 / (1 - cos wT) Re((1 - exp(-j wT)) H(exp(j wT)))   at all w,

    gives the rest: a delay of d ticks turns K T/2 into K T/2 sin((2 d + 1) wT/2) / sin(wT/2), at most 2 d + 1 times as
    much, at w = 0, and the damping into -B cos((d + 1) wT). Both worst cases together may be more than there is at
    any one frequency, so with delay and damping the bound is on the safe side.

    Args:
        damping: b, of device and hand [N s/m], >= 0.
        tick_period: T [s], > 0.
        delay_ticks: t in ticks, from the sampling of a position to the force that answers it, >= 0.
        wall_damping: B [N s/m].
    """
    return max(0.0, (damping - abs(wall_damping)) / (tick_period * (0.5 + delay_ticks)))
