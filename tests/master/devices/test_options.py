"""Options of the drivers that no type alone refuses: what is refused is named, and what lies at the limit is taken.

And the check of signs: without it a device with motors has no force, and it is of the settings that turn them alone.
"""

import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from weberlink.geometry.vector import ZERO
from weberlink.master.devices import load
from weberlink.master.devices.leaders import load as load_leader

TICK = 0.001
REACH = {"motion": "reach", "to_m": [0.2, 0, 0]}
REST = {"motion": "rest"}
TURN = {"motion": "turn", "turn_deg": [0, 0, 9]}
HOLD = {"motion": "hold", "duration_s": 1.0}
NINE_BYTES = {"parameters": "aluhaptics_v2"}

REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("force_dimension", {"force_n": 12.1}, "force_n: expected at most 12 N for omega.3"),
    ("force_dimension", {"torque_n_m": 0.1}, "torque_n_m: expected at most 0 N m"),
    ("force_dimension", {"watchdog_ms": 4.99}, "watchdog_ms: expected 0, or at least 5"),
    ("force_dimension", {"watchdog_ms": 31.9}, "watchdog_ms"),
    ("inverse3", {"port": "ws://host:1/path"}, "port"),
    ("operator", {"script": [REACH]}, "script.0: expected motion within the workspace"),
    ("operator", {"script": [REST, {"motion": "press", "at_m": [0, 0, 0], "depth_m": 0.1}]}, "script.1"),
    ("operator", {"script": [{"motion": "reach", "to_m": [0, 0, 0], "duration_s": 0}]}, "duration_s"),
    ("operator", {"script": [{"motion": "slide", "points_m": [[0, 0, 0]]}]}, "points_m"),
    ("operator", {"wrist": {"stiffness_n_m_rad": 0}}, "wrist.stiffness_n_m_rad"),
    ("operator", {"wrist": {}, "script": [{"motion": "turn", "turn_deg": [0, 150, 150]}]}, "at most half a turn"),
    ("operator", {"script": [TURN]}, "script.0.turn_deg: only a hand with a wrist"),
    ("operator", {"script": [REST, {**TURN, "motion": "reach", "to_m": [0, 0, 0]}]}, "script.1.turn_deg"),
    ("operator", {"home_m": [0.0, 0.0, 0.0601]}, "home_m"),
    ("polhem_hid", {"report_bytes": 8, "directions": (1, 1, 1)}, "directions"),
    ("polhem_hid", {"directions": (1, 1, 1), "motor_directions": (1, 1, 1)}, "directions: leave it out beside"),
    ("polhem_hid", NINE_BYTES, "published for 8-byte reports, not for 14-byte reports: set encoder_dir"),
    ("polhem_hid", {**NINE_BYTES, "encoder_directions": (1, 1, 1)}, "published for 8-byte reports"),
    ("polhem_hid", {"parameters": "vintage_phantom", "directions": (1, 1, 1)}, "published for the serial board"),
    ("polhem_hid", {"parameters": "vintage_phantom_2021", "gravity_compensation": True}, "no masses are published"),
    ("polhem_hid", {"force_n": 5.01}, "force_n: expected at most 5 N"),
    ("replay", {"axes": "+x+y+y"}, "axes"),
    ("replay", {"trace": "nowhere.csv"}, "nowhere.csv: not found"),
    ("replay", {"scale": 100.0}, "trace: .* beyond the workspace"),
    ("spacemouse", {"home_m": (0.0, 0.0, 0.0601)}, "home_m: expected a point within"),
    ("arm_operator", {"script": [{"motion": "move", "joints_rad": (0.0,)}]}, "script.0.joints_rad: expected 5 angles"),
    ("arm_operator", {"script": [HOLD, {"motion": "move", "gripper_rad": 9.0}]}, "script.1: gripper: expected 0 to"),
    ("arm_operator", {"script": [{"motion": "swing", "amplitude_rad": (1.0,)}]}, "script.0.amplitude_rad"),
    ("arm_operator", {"hand": {"damping_nm_s_rad": (1.0,)}}, "hand.damping_nm_s_rad: expected one value"),
    ("arm_operator", {"hand": {"stiffness_nm_rad": 0.0}}, "hand.stiffness_nm_rad: expected 1e-06 to "),
]
TAKEN: list[tuple[str, dict[str, Any]]] = [
    ("force_dimension", {"force_n": 12.0, "watchdog_ms": 5.0}),
    ("force_dimension", {"watchdog_ms": 31.875}),
    ("force_dimension", {"watchdog_ms": 0.0}),
    ("inverse3", {"port": "ws://host:1/#0A"}),
    ("operator", {"home_m": [0.0, 0.0, 0.06], "script": [{**REACH, "to_m": [0.06, -0.06, 0.06]}]}),
    ("operator", {"wrist": {}, "script": [{"motion": "turn", "turn_deg": [0, 0, -180]}]}),
    ("polhem_hid", {"force_n": 5.0}),
    ("spacemouse", {"home_m": (0.06, -0.06, 0.06)}),
]


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "still.csv"
    path.write_text("t,px,py,pz,fx,fy,fz\n" + "".join(f"{0.01 * i},{1e-3 * i},0,0,0,0,0\n" for i in range(20)))
    return path


def made(name: str, options: dict[str, Any], recording: Path) -> Any:
    """A device from options, as the daemon makes it."""
    driver: Any = load_leader(name) if name == "arm_operator" else load(name)
    needed = {"trace": recording} if name == "replay" else {}
    return driver(driver.Options.model_validate({**needed, **options}), TICK)


@pytest.mark.parametrize(("name", "options", "named"), REFUSED)
def test_what_cannot_be_is_refused_by_name(name: str, options: dict[str, Any], named: str, recording: Path) -> None:
    with pytest.raises(ValueError, match=r"\S") as caught:
        made(name, options, recording)
    error = caught.value
    where = [".".join(map(str, each["loc"])) for each in error.errors()] if isinstance(error, ValidationError) else []
    told = "\n".join([*where, str(error)])
    assert re.search(named, told), told


@pytest.mark.parametrize(("name", "options"), TAKEN)
def test_what_lies_at_the_limit_is_taken(name: str, options: dict[str, Any], recording: Path) -> None:
    assert made(name, options, recording).spec.name == name


ARMED: dict[str, tuple[dict[str, Any], list[dict[str, Any]], dict[str, Any]]] = {
    "force_dimension": ({}, [{"model": "omega.6"}, {"serial_number": 7}], {"force_n": 1.0}),
    "haply_2diy": (
        {},
        [
            {"version": "v2"},
            {"motor_directions": ("cw", "ccw")},
            {"encoder_directions": ("ccw", "cw")},
            {"home_deg": (167.0, 12.0)},
        ],
        {"port": "/dev/null", "force_n": 1.0, "motor_directions": ("ccw", "ccw")},
    ),
    "inverse3": ({}, [{"preset": "led_front"}, {"preset": None}], {"force_n": 1.0}),
    "polhem_hid": (
        {},
        [
            {"encoder_directions": (1, -1, 1)},
            {"motor_directions": (1, -1, 1)},
            {"directions": (1, -1, 1)},
            {"report_bytes": 8},
            {"home_counts": (0, 0, -5999)},
            {"parameters": "woodenhaptics_2019"},
            {"parameters": "polhem_v3"},
        ],
        {"force_n": 1.0},
    ),
    "polhem_serial": ({"model": "woodenhaptics"}, [{"model": "polhem"}, {"model": "auto"}], {"force_n": 1.0}),
    "touch": ({}, [], {"force_n": 1.0}),
}
"""Options of a driver, those that need another check of signs, and those that do not."""


@pytest.mark.parametrize("name", ARMED)
def test_without_its_check_of_signs_a_device_has_no_force(name: str) -> None:
    options, others, same = ARMED[name]
    driver: Any = load(name)

    def device(**settings: Any) -> Any:
        return driver(driver.Options(**{**options, **settings}), TICK)

    prints = [driver.fingerprint(driver.Options(**{**options, **each})) for each in ({}, *others)]
    assert len(set(prints)) == len(prints)
    assert all(re.fullmatch("[a-f][0-9a-f]{7}", each) for each in prints), "a text in YAML, not a number"
    assert driver.fingerprint(driver.Options(**options, **same)) == prints[0]
    checked = device(signs_checked=prints[0], **same).spec
    assert (checked.force_feedback, checked.force_n) == (True, 1.0)
    for settings in ({}, {"signs_checked": "a0000000"}, *({**each, "signs_checked": prints[0]} for each in others)):
        spec = device(**settings).spec
        assert (spec.force_n, spec.force_feedback, spec.watchdog_s) == (0.0, False, checked.watchdog_s)
        assert f"weberlink device test {name}" in spec.note or "set master.device.model" in spec.note
    assert checked.workspace_m[0] < ZERO < checked.workspace_m[1]
