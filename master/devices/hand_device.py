"""The device of `operator` and `replay`: a modelled hand on a handle, moved by an intention."""

from collections.abc import Callable
from random import Random
from typing import TYPE_CHECKING, ClassVar

from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import ZERO, Vector, add, confined, cube, norm, within
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec, check_finite
from weberlink.master.devices.hand import Tremor, modelled_hand
from weberlink.master.devices.hand_options import HandDeviceOptions

if TYPE_CHECKING:
    from weberlink.master.devices.turning import Turning

LONGEST_GAP = 0.1  # [s] of model time per call; a longer silence makes the hand pause, it does not jump


@mypyc_attr(allow_interpreted_subclasses=True)
class HandDevice:
    """Moves a hand toward an intention, against the commanded force; with a wrist, turns it too.

    Time is that of the model: it goes on with `now`, in equal steps of about a tick, by at most 0.1 s a call. The
    handle stays within the workspace, as on a device with end stops. `intention` gives where the hand means to be at a
    model time [s] from `open`, and whether that is over; `turning` the rotation vector [rad], only with a wrist.
    """

    COMPUTED: ClassVar[bool] = True

    def __init__(
        self,
        name: str,
        options: HandDeviceOptions,
        intention: Callable[[float], tuple[Vector, bool]],
        tick_period: float,
        turning: Callable[[float], Vector] = lambda _: ZERO,
    ) -> None:
        self.spec = DeviceSpec(
            name=name,
            axes="xyz",
            force_n=options.force_n,
            stiffness_n_m=options.stiffness_n_m,
            workspace_m=cube(options.workspace_m),
            rate_hz=1.0 / tick_period,
            force_feedback=True,
            orientation=options.wrist is not None,
            torque_n_m=0.0 if options.wrist is None else options.torque_n_m,
            watchdog_s=0.0,
        )
        self._options = options
        self._intention = intention
        self._tick_period = tick_period
        self._tremor: Tremor | None = None
        if options.tremor_m > 0.0:
            self._tremor = Tremor(options.tremor_m, options.hand, Random(options.seed).random)  # noqa: S311
        self._turning: "Turning | None" = None  # noqa: UP037 - imported below
        if options.wrist is not None:
            from weberlink.master.devices.turning import Turning  # noqa: PLC0415 - with a wrist only

            uniform = Random(f"wrist {options.seed}").random  # noqa: S311
            self._turning = Turning(options.wrist, turning, uniform)
        self._hand = modelled_hand(options.hand, options.home_m)
        self._elapsed = 0.0
        self._felt = ZERO
        self._torque = ZERO
        self._reading: DeviceReading | None = None

    def open(self, now: float) -> None:
        self._hand = modelled_hand(self._options.hand, self._options.home_m)
        self._elapsed = 0.0
        self._felt = self._torque = ZERO
        if self._turning is not None:
            self._turning.begin()
        orientation = None if self._turning is None else self._turning.orientation
        self._reading = DeviceReading(now, self._hand.position, False, orientation)

    def latest(self, now: float) -> DeviceReading:
        reading = self._reading
        if reading is None:
            raise DeviceFault(f"{self.spec.name}: not open")
        if now <= reading.at:
            return reading
        gap = now - reading.at
        gap = gap if gap < LONGEST_GAP else LONGEST_GAP
        count = round(gap / self._tick_period) or 1  # the hand moves exactly at any step
        step = gap / count
        ended = reading.ended
        for _ in range(count):
            self._elapsed += step
            intended, ended = self._intention(self._elapsed)
            if self._tremor is not None:
                intended = add(intended, self._tremor.at(self._elapsed))
            self._hand.advance(intended, self._felt, step)
            if self._turning is not None:
                self._turning.advance(self._elapsed, self._torque, step)
        orientation = None if self._turning is None else self._turning.orientation
        self._reading = DeviceReading(now, confined(self._hand.position, self.spec.workspace_m), ended, orientation)
        return self._reading

    def command(self, force: Vector, now: float) -> None:  # noqa: ARG002
        if not norm(force) <= self.spec.force_n:
            check_finite(self.spec.name, "force", force)
            force = within(force, self.spec.force_n)
        self._felt = force

    def turn(self, torque: Vector, now: float) -> None:  # noqa: ARG002
        """Has no effect without a wrist."""
        check_finite(self.spec.name, "torque", torque)
        self._torque = within(torque, self.spec.torque_n_m)

    def close(self) -> None:
        self._reading = None
        self._felt = self._torque = ZERO
