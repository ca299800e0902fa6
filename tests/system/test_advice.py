"""Advice on a file: one list, which `check` prints and every command that runs the file says once, before the run."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.system.systems import CONFIGS, configuration
from weberlink.control.passivity import passivity_limit
from weberlink.system.advice import UNKNOWN_BORNE, advise, borne_round_trip, on_measured_delay, uncontrolled_delay
from weberlink.system.composition.trial import try_out
from weberlink.system.configuration import SLAVE, load

LOOPBACK = CONFIGS / "loopback.yaml"


def at(port: int) -> tuple[str, str]:
    return f"link.listen=127.0.0.1:{port}", f"link.slave=127.0.0.1:{port}"


# --- the delay that a contact bears without control


@given(
    damping=st.floats(1.0, 30.0),
    wall=st.floats(50.0, 2000.0),
    wall_damping=st.floats(0.0, 0.9),
    rate=st.floats(100.0, 5000.0),
)
def test_none_bears_the_delay_up_to_which_hand_and_wall_are_passive(
    damping: float, wall: float, wall_damping: float, rate: float
) -> None:
    parts = try_out(
        configuration(
            f"master.device.hand.damping_n_s_m={damping!r}",
            f"rate_hz={rate!r}",
            f"slave.scene=[{{shape: plane, stiffness_n_m: {wall!r}, damping_n_s_m: {wall_damping!r}}}]",
            "control.scheme=none",
            "link.silence_ms=1000",
        )
    )
    assert parts.robot is not None
    coupling, borne = parts.robot.spec.stiffness_n_m, borne_round_trip(parts)
    felt, felt_damping = min(wall, coupling), wall_damping * min(1.0, coupling / wall)
    limit = passivity_limit(damping, 1.0 / rate, delay_ticks=1.0 + borne * rate, wall_damping=felt_damping)
    assert limit == pytest.approx(felt) if borne > 0.0 else limit <= felt * (1.0 + 1e-9)
    assert uncontrolled_delay(parts, 0.999 * borne) is None
    assert uncontrolled_delay(parts, 1.001 * borne + 1e-6) is not None


def test_of_a_hand_that_is_not_known_none_bears_little() -> None:
    assert borne_round_trip(try_out(load(LOOPBACK, at(47011), [SLAVE]))) == UNKNOWN_BORNE


@pytest.mark.parametrize(
    ("file", "overrides"), [("loopback.yaml", ()), ("arms.yaml", ("link.security=none",)), ("rotation.yaml", ())]
)
def test_advice_names_the_scheme_that_bounds_the_energy(file: str, overrides: tuple[str, ...]) -> None:
    overrides = ("control.scheme=none", *overrides)
    if file == "arms.yaml":
        pytest.importorskip("mujoco")
    said = uncontrolled_delay(try_out(configuration(*overrides, file=file)), 0.1)
    assert said is not None and said.endswith("use bounded")
    (line,) = [
        line
        for line in advise(try_out(configuration(*overrides, "link.emulate.delay_ms=50", file=file)))
        if line.startswith("control.scheme none")
    ]
    assert line == said


def test_a_scheme_that_bounds_the_energy_bears_every_delay() -> None:
    assert uncontrolled_delay(try_out(configuration("control.scheme=bounded")), 1.0) is None


def test_a_measured_delay_is_said_unless_the_emulated_one_was() -> None:
    none = "control.scheme=none"
    assert on_measured_delay(try_out(configuration(none)))(0.05) is not None
    assert on_measured_delay(try_out(configuration(none)))(0.001) is None
    assert on_measured_delay(try_out(configuration(none, "link.emulate.delay_ms=20")))(0.05) is None
