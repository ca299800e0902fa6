"""Whether angles can be true, by what is known of the arms and by what came before. Pure: `now` is an argument.

The board's replies have no checksum. A byte that is lost shows in the length or the number of the device, or else in
angles that no arm could have.
"""

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.haply.fivebar import FiveBar, Pair, Unreachable

FASTEST = 50.0
"""[rad/s]; a hand at 1 m/s turns an arm of 7 cm at 14."""
WIDEST = 3.5
"""How far an arm turns from its starting place at most [rad]; with the other arm in the way it is less."""
STUCK_TRAVEL = 1.5
"""How far one arm turns while the other does not by a single count before that encoder counts as broken [rad]."""


class Track:
    """Follows the angles of one session.

    Args:
        bar: the linkage.
        home: angles of the arms at the starting place [rad].
        resolution: of the encoders [rad].
    """

    def __init__(self, bar: FiveBar, home: Pair, resolution: Pair) -> None:
        self._bar = bar
        self._home = home
        self._resolution = resolution
        self._last: Pair | None = None
        self._asked_at = 0.0
        self._travel = [0.0, 0.0]

    def follow(self, angles: Pair, asked_at: float, now: float) -> Pair:
        """Take over angles [rad], and give the tip [m, frame of the linkage].

        They were measured some time between `asked_at` and `now` [s]: a host that stalls gets an answer late.

        Raises:
            BadReply: no posture is like this, or none that the arms could have come to since the last one.
            HardwareFault: an encoder has stood still for too long.
        """
        for number, (angle, home) in enumerate(zip(angles, self._home, strict=True), 1):
            if abs(angle - home) > WIDEST:
                raise BadReply(f"arm {number} at {angle:.2f} rad, out of its range: bytes were lost")
        try:
            tip = self._bar.tip(angles)
        except Unreachable as error:
            raise BadReply(f"{error}: bytes were lost, or the handle was not at its starting place") from None
        if self._last is not None:
            self._compare(angles, self._last, max(0.0, now - self._asked_at))
        self._last, self._asked_at = angles, asked_at
        self._check_travel()
        return tip

    def _compare(self, angles: Pair, last: Pair, elapsed: float) -> None:
        steps = [abs(angle - before) for angle, before in zip(angles, last, strict=True)]
        for number, (step, resolution) in enumerate(zip(steps, self._resolution, strict=True), 1):
            if step > FASTEST * elapsed + 1.5 * resolution:
                raise BadReply(f"arm {number} jumped by {step:.2f} rad within {elapsed * 1e3:.1f} ms: bytes were lost")
        for mine, other in ((0, 1), (1, 0)):
            moved = steps[mine] > 0.5 * self._resolution[mine]
            self._travel[mine] = 0.0 if moved else self._travel[mine] + steps[other]

    def _check_travel(self) -> None:
        for index, travel in enumerate(self._travel):
            if travel > STUCK_TRAVEL:
                raise HardwareFault(
                    f"encoder {index + 1} stands still though the other arm turned by {travel:.1f} rad; "
                    "check its cable, put the handle at its starting place and start again"
                )
