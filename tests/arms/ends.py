"""Stand-ins for the arms, the control schemes and the endpoint of a port, in virtual time."""

from collections import Counter
from dataclasses import replace
from math import inf
from types import SimpleNamespace
from typing import Any

from weberlink.arms.contract import ArmReading, ArmSpec
from weberlink.arms.sensor import AxesSensor, Quantity, sensors_of
from weberlink.codec.channel import joint_channel
from weberlink.geometry.joints import Joints

TICK = 1e-3
SPEC = ArmSpec(
    name="arm", joints=("base", "elbow"), gripper=True, lower=(-2.0, -1.5, 0.0), upper=(2.0, 1.5, 1.0),
    torque_nm=(1.0, 1.0, 0.5), stiffness_nm_rad=(10.0, 10.0, 5.0), rate_hz=1000.0, calibrated=True, buttons=2,
    watchdog_s=0.0,
)  # fmt: skip


def spec(**changes: Any) -> ArmSpec:
    return replace(SPEC, **changes)


def sensors(quantity: Quantity, spec: ArmSpec = SPEC) -> list[AxesSensor]:
    """What senses an arm, and encodes it."""
    widths = (len(spec.joints), 1) if spec.gripper else (len(spec.joints),)
    return sensors_of(spec, quantity, [joint_channel(bounds=(0.1,) * width, step=0.01) for width in widths])


class Hand:
    """A leader arm where a test puts it."""

    def __init__(self, spec: ArmSpec = SPEC) -> None:
        self.spec = spec
        self.angles: Joints = (0.0,) * spec.axes
        self.buttons = 0
        self.felt: list[Joints] = []

    def open(self, now: float) -> None: ...

    def latest(self, now: float) -> ArmReading:
        return ArmReading(now, self.angles, (0.0,) * self.spec.axes, buttons=self.buttons)

    def command(self, values: Joints, now: float) -> None:
        self.felt.append(values)

    def close(self) -> None: ...


class Servos:
    """A follower arm without inertia: springs pull to the command less the `sag`, walls stop from above [rad]."""

    def __init__(
        self, spec: ArmSpec = SPEC, *, walls: Joints | None = None, angles: Joints | None = None, sag: float = 0.0
    ) -> None:
        self.spec = spec
        self.walls = walls or (-inf,) * spec.axes
        self.angles: Joints = angles or (0.0,) * spec.axes
        self.commands: list[Joints] = []
        self.torques: Joints = (0.0,) * spec.axes
        self.sag = sag
        self.is_open = False

    def open(self, now: float) -> None:
        self.is_open = True

    def latest(self, now: float) -> ArmReading:
        return ArmReading(now, self.angles, self.torques)

    def command(self, values: Joints, now: float) -> None:
        self.commands.append(values)
        free = [angle - self.sag for angle in values]
        self.angles = tuple(max(angle, wall) for angle, wall in zip(free, self.walls, strict=True))
        self.torques = tuple(
            k * (there - angle) for k, there, angle in zip(self.spec.stiffness_nm_rad, self.angles, free, strict=True)
        )

    def close(self) -> None:
        self.is_open = False


class Transparent:
    """The leader's end of a control scheme that changes nothing, and remembers what it was told."""

    credit = 0

    def __init__(self) -> None:
        self.told: list[tuple[Any, ...]] = []
        self.resumed = 0
        self.answer: Joints | None = None  # instead of what `render` is given

    def resume(self, peer_credit: int) -> None:
        self.resumed += 1

    def observe(self, *values: Any) -> None:
        self.told.append(values)

    def render(self, torque: Joints) -> Joints:
        return self.answer or torque

    def displayed(self, torque: Joints) -> None:
        self.told.append(("displayed", torque))


def link(rtt: float | None = None, jitter: float = 0.0) -> Any:
    """An endpoint in touch with its peer, that counts what it is asked to send; set `liveness`."""
    asked = Counter[str]()
    return SimpleNamespace(
        credit=SimpleNamespace(known=0),
        clock=SimpleNamespace(rtt=rtt, jitter=jitter),
        liveness=SimpleNamespace(in_touch_at=0.0, encoder_heard_at=0.0),
        statistics=SimpleNamespace(outgoing_loss=0.0, outgoing_burst=0.0),
        request_answer=lambda: asked.update(["answer"]),
        request_full_state=lambda: asked.update(["full state"]),
        asked=asked,
    )
