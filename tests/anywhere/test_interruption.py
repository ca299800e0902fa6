"""The judge of interruptions passes a lawful course, and finds each promise that is broken."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.anywhere.hosts import SHIPPED
from tests.anywhere.interruption import EITHER, NOTHING, SILENCE, measure, violated
from tests.program import Records
from weberlink.protocol.states import State
from weberlink.system.configuration import MASTER, Configuration, load
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE

FAILED, RESTORED, END = 1.0, 3.0, 5.0
SILENT_AT, BACK_AT = 1.15, 3.2
"""150 ms after the last datagram, and some time after the path is good again."""
CONTACT_N = 1.0


@pytest.fixture(scope="module")
def loaded() -> Configuration:
    return load(SHIPPED, ("link.path=direct", "link.security=none", "link.listen=127.0.0.1:0"), [MASTER])


def course() -> tuple[Records, Records]:
    """Master and slave: silence, force faded out before it, a retreat of 10 mm, and back again."""
    sides = []
    for _ in range(2):
        records = np.zeros(round(END * 1e3), DTYPE)
        at = records["at"] = np.arange(len(records)) * 1e-3
        alone = (at >= SILENT_AT) & (at < BACK_AT)
        records["state"] = np.where(alone, State.SILENT.value, State.ENGAGED.value)
        records["fault"] = np.where(alone, Fault.SILENCE.value, 0)
        records["datagrams_received"] = np.cumsum((at < FAILED) | (at >= RESTORED))
        sides.append(records)
    master, slave = sides
    at = master["at"]
    faded = np.clip((SILENT_AT - at) / 0.03, 0.0, 1.0) + np.clip((at - BACK_AT) / 0.2, 0.0, 1.0)
    master["output"][:, 2] = CONTACT_N * faded
    # At 0.1 m/s away from the surface; then down again at the same speed.
    up = np.clip((at - SILENT_AT) * 0.1, 0.0, 0.01) - np.clip((at - BACK_AT) * 0.1, 0.0, 0.01)
    slave["output"][:, 2] = up - 0.001
    return master, slave


def broken(master: Records, slave: Records, loaded: Configuration, effect: str = SILENCE) -> list[str]:
    return violated(measure(master, slave, FAILED, RESTORED, loaded), loaded, effect)


def test_lawful_course_breaks_nothing(loaded: Configuration) -> None:
    master, slave = course()
    assert broken(master, slave, loaded) == broken(master, slave, loaded, EITHER) == []


def test_figures_are_those_of_the_course(loaded: Configuration) -> None:
    found = measure(*course(), FAILED, RESTORED, loaded)
    assert found.contact_n == CONTACT_N
    assert found.away_ms == pytest.approx(1e3 * (BACK_AT - SILENT_AT), abs=2.0)
    assert found.back_ms == pytest.approx(1e3 * (BACK_AT - RESTORED), abs=2.0)
    assert found.force_ms == pytest.approx(150.0, abs=3.0)
    assert found.retreat_mm == pytest.approx((10.0, 0.0), abs=0.2)
    assert (found.faults, found.sessions) == ((("silence",), ("silence",)), 1)


def test_session_that_lasts_is_no_silence(loaded: Configuration) -> None:
    master, slave = course()
    for side in (master, slave):
        side["state"], side["fault"] = State.ENGAGED.value, 0
    master["output"][:, 2], slave["output"][:, 2] = CONTACT_N, 0.0
    assert broken(master, slave, loaded, NOTHING) == []
    assert broken(master, slave, loaded) != []


def force_stays(master: Records, slave: Records) -> None:
    master["output"][(master["at"] > 1.0) & (master["at"] < 1.4), 2] = CONTACT_N


def robot_goes_on(master: Records, slave: Records) -> None:
    late = slave["at"] >= SILENT_AT
    slave["state"][late & (slave["at"] < 1.4)] = State.ENGAGED.value
    slave["output"][:, 0] = np.minimum(slave["at"], 1.4) * 0.01


def robot_wanders(master: Records, slave: Records) -> None:
    slave["output"][:, 0] = np.clip((slave["at"] - 1.5) * 0.1, 0.0, 0.02)


def force_jumps_back(master: Records, slave: Records) -> None:
    master["output"][master["at"] >= BACK_AT, 2] = CONTACT_N


def robot_jumps_back(master: Records, slave: Records) -> None:
    slave["output"][slave["at"] >= BACK_AT + 0.01, 2] = -0.001


def force_leaps(master: Records, slave: Records) -> None:
    master["output"][master["at"] >= 4.0, 2] = 5.0


def never_returns(master: Records, slave: Records) -> None:
    master["state"][master["at"] >= BACK_AT] = State.SILENT.value


def names_no_fault(master: Records, slave: Records) -> None:
    slave["fault"] = 0


@pytest.mark.parametrize(
    ("deed", "said"),
    [
        (force_stays, "force was on the hand 4"),
        (robot_goes_on, "the robot moved 40"),
        (robot_wanders, "20.0 mm otherwise"),
        (force_jumps_back, "above its ramp"),
        (robot_jumps_back, "the robot came back by"),
        (force_leaps, "the force changed by"),
        (never_returns, "no session after"),
        (names_no_fault, "an end named no fault"),
    ],
)
def test_broken_promise_is_found(deed: Callable[[Records, Records], None], said: str, loaded: Configuration) -> None:
    master, slave = course()
    deed(master, slave)
    found = broken(master, slave, loaded)
    assert any(said in line for line in found), found
