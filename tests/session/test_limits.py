"""Limits of force, torque, their rate, speed, and of the workspace, in sessions of every kind."""

from typing import Any

import numpy as np
import pytest

from tests.session.kinds import HAND, KINDS, STEP, TICK, run


class Thrown(HAND.robot):  # type: ignore[misc]
    """A robot whose sensor says this and its negative in turn, whatever it touches."""

    def latest(self, now: float) -> Any:
        sign = 1.0 if int(now / 0.02) % 2 else -1.0
        return super().latest(now)._replace(force=(0.0, 0.0, 10.0 * sign), torque=(0.0, 0.3 * sign, 0.0))


LIMITS = [
    ("hand", ("master.limits.force_n=1.5",), "felt", 0, 1.5, None),
    ("turning", ("master.limits.torque_nm=0.01",), "felt", 1, 0.01, None),
    ("arm", ("master.limits.joints={torque_nm: 0.3}",), "felt", 0, 0.3, None),
    ("hand", ("slave.limits.speed_m_s=0.05", "slave.limits.approach_speed_m_s=0.05"), "moved", 0, 0.05 * TICK, None),
    ("turning", ("slave.limits.turn_rad_s=0.3", "slave.limits.approach_turn_rad_s=0.3"), "moved", 1, 0.3 * TICK, None),
    ("hand", ("slave.limits.contact_n=2",), "pressed", 0, 2.0, None),
    ("hand", ("control.scheme=none",), "changed", 0, 3000 * TICK + 10.0 * STEP, Thrown),
    ("hand", ("control.scheme=none", "master.limits.slew_n_s=500"), "changed", 0, 0.5 + 10.0 * STEP, Thrown),
    ("turning", ("master.limits.slew_nm_s=20",), "changed", 1, 0.02 + 0.5 * STEP, Thrown),
    ("turning", (), "changed", 1, 0.125 + 0.5 * STEP, Thrown),
]


@pytest.mark.parametrize(
    ("name", "overrides", "what", "place", "limit", "robot"), [row for row in LIMITS if row[0] in KINDS]
)
def test_each_limit_holds_at_every_tick_and_is_reached(
    name: str, overrides: tuple[str, ...], what: str, place: int, limit: float, robot: Any
) -> None:
    kind = KINDS[name]
    ran = run(kind, 2.0, *overrides, robot=robot)
    channel = kind.channels[place]
    seen, told = {
        "felt": (channel.size(channel.output(ran.master)), ran.master["clipped"]),
        "changed": (channel.steps(ran.master), ran.master["slew_ticks"]),
        "moved": (channel.steps(ran.slave), ran.slave["clipped"]),
        "pressed": (channel.size(channel.raw(ran.slave)), ran.slave["contact_ticks"]),
    }[what]
    assert 0.6 * limit <= seen.max() <= limit * (1.05 if what == "pressed" else 1.005)
    assert told.any()


WITHIN = np.array([[-0.05, 0.05], [-0.05, 0.05], [-0.05, 0.001]])


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("slave.limits.on_silence=retract", "slave.limits.retract_m=0.02", "link.emulate.blackouts_s=[[1.5, 0.4]]"),
        ("slave.limits.trip_n=2", "codec.force.predictor=zoh"),
    ],
    ids=["follows", "retreats", "trips"],
)
def test_the_robot_stays_within_its_workspace_whatever_it_does(overrides: tuple[str, ...]) -> None:
    """The edge is a millimetre above the surface: less than any retreat. Where it begins is outside."""
    ran = run(HAND, 2.2, f"slave.limits.workspace_m={WITHIN.tolist()}", *overrides)
    output = HAND.channels[0].output(ran.slave)
    inside = int(np.argmax(output[:, 2] <= 0.001))
    assert 0 < inside < 1000
    assert ((output[inside:] >= WITHIN[:, 0]) & (output[inside:] <= WITHIN[:, 1])).all()
    assert (np.diff(output[:inside, 2]) <= 0.0).all()
    assert (output[inside:, 2] == 0.001).any()
    assert ran.slave["clipped"].any()
