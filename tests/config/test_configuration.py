"""Configurations: what is refused, by the path of its field; what is accepted, and what it becomes."""

import json
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import Field, create_model

from tests.session.packages import install
from tests.session.systems import ARMS, CONFIGS, HAS_ARMS, configuration
from weberlink.codec.deadband import ForceDeadband
from weberlink.config import MASTER, SLAVE, ConfigurationError, load
from weberlink.config.errors import validated
from weberlink.config.model import System
from weberlink.master.devices.operator import OperatorDevice
from weberlink.options import Options
from weberlink.session.advice import dry_run
from weberlink.session.composition.channels import streams
from weberlink.session.simulation import build_simulation

MINIMAL = "link: {listen: 127.0.0.1:0, slave: 127.0.0.1:0, security: none}\n"
PLANE = "slave: {scene: [{shape: plane, stiffness_n_m: 500}]}\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "system.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def refusal(path: Path, *overrides: str, sides: Any = None) -> str:
    """The line that says why a file is refused, at the latest when its parts are built."""
    with pytest.raises(ConfigurationError) as caught:
        dry_run(load(path, overrides) if sides is None else load(path, overrides, sides=sides))
    message = str(caught.value)
    assert "\n" not in message
    return message


# --- refused

REFUSED: dict[str, list[tuple[str, str]]] = {
    "loopback.yaml": [
        ("codek={}", "codek: unknown key; did you mean codec?"),
        (
            "slave.scene=[{shape: sphere, stiffness_n_m: 3, radius: 3}]",
            "slave.scene.0.radius: unknown key; did you mean radius_m?",
        ),
        ("codec.force.deadband={shape: isotropic, slope_s_m: 1}", "unknown key; known are shape"),
        ("codec.joints={names: [a], angle: {bound_rad: 5}}", "codec.joints.angle.bound_rad: should be less than"),
        ("codec.force.weber=ten", "codec.force.weber: should be a number, not 'ten'"),
        ("=1", "path.to.key=value"),
        ("codec.force.predictor=spline", "codec.force.predictor"),
        ("codec.force.deadband={shape: wedge}", "codec.force.deadband"),
        ("codec.position.bound_m=0.06", "codec.position.bound_m"),
        ("link={finder: {driver: nobody}}", "link.finder.driver: no path finder is called 'nobody'"),
        ("link.finder={driver: nobody}", "finder has the key; leave security out"),
        ("link.stun=a:1", "did you mean listen? Options of a driver belong into link.finder"),
        ("link.slave=host:99999", "link.slave"),
        ("link.slave=10.0.0.2:47000", "link: security"),
        ("link.security=psk", "key_file"),
        ("link.playout_ms=51", "link.playout_ms"),
        ("link.emulate={loss: 0.9, to_slave: {burst: 5}}", "link.emulate: loss"),
        ("link.emulate={blackouts_s: [[0, 1, 0]]}", "link.emulate.blackouts_s"),
        ("master.engage={button: 0}", "master.engage.button"),
        ("master.mapping={clutch: {button: 0}}", "master.mapping"),
        ("master.mapping={clutch: {button: 0}, walls: {}}", "master.mapping.clutch.button"),
        ("master.mapping={scale: 20}", "codec.position.step_m"),
        ("master.mapping={rotation: [0, 0, 90]}", "master.mapping.rotation"),
        ("master.mapping={walls: {box_m: [[0, 1], [1, 0], [0, 1]]}}", "master.mapping.walls.box_m"),
        ("slave.scene=[{shape: plane}]", "slave.scene.0.stiffness_n_m"),
        ("slave.limits.workspace_m=[[0, 1], [1, 0], [0, 1]]", "slave.limits.workspace_m"),
        ("slave.limits.contact_n=31", "slave.limits.contact_n"),
        ("slave.limits={contact_n: 8, trip_n: 5}", "slave.limits"),
        ("slave.limits.contact_n=0.1 & codec.force.floor_n=0.2", "slave.limits.contact_n"),
        ("master.limits.force_n=1 & master.mapping.force_scale=100", "master.limits.force_n"),
    ],
    "rotation.yaml": [
        ("master.device={driver: operator}", "codec.rotation: master.device"),
        ("slave.robot={driver: point}", "codec.rotation: slave.robot"),
        ("codec.rotation.torque.step_nm=0.00001", "codec.rotation.torque.step_nm"),
    ],
    ARMS.name: [
        ("codec.joints.names=[a, a]", "codec.joints"),
        ("codec.joints.names=[a, b]", "codec.joints.names"),
        ("codec.joints.angle.bound_rad=[0.1, -1, 0.1, 0.1, 0.1]", "codec.joints.angle.bound_rad.1"),
        ("codec.joints.torque.predictor=hybrid", "codec.joints.torque.predictor"),
        ("codec.gripper=null", "codec.gripper"),
        ("codec.joints=null", "gripper"),
        ("master.mapping={}", "master.mapping"),
        ("slave.limits.joints={upper_rad: -3}", "slave.limits.joints"),
        ("master.limits.joints={torque_nm: [1, 2]}", "master.limits.joints.torque_nm"),
        ("master.engage={button: 0}", "master.engage.button"),
    ],
}
"""By shipped file: an override, or two with & between, and the field that the refusal names."""


@pytest.mark.parametrize(("file", "override", "field"), [(file, *row) for file in REFUSED for row in REFUSED[file]])
def test_what_is_wrong_is_refused_in_one_line_by_the_path_of_its_field(file: str, override: str, field: str) -> None:
    if file == ARMS.name and not HAS_ARMS:
        pytest.skip("what computes arms is not installed")
    message = refusal(ARMS if file == ARMS.name else CONFIGS / file, *override.split(" & "))
    assert field in message
    assert file in message or "--set" in message or override in message


class WithButtons(OperatorDevice):
    """With the buttons 0 and 1."""

    def __init__(self, options: Any, tick_period: float) -> None:
        super().__init__(options, tick_period)
        self.spec = replace(self.spec, buttons=2)


@pytest.mark.parametrize(
    ("engage", "clutch", "is_refused"), [(1, None, False), (2, None, True), (1, 0, False), (1, 1, True), (0, 2, True)]
)
def test_a_button_is_there_and_has_one_use(engage: int, clutch: int | None, is_refused: bool) -> None:
    mapping = "null" if clutch is None else f"{{clutch: {{button: {clutch}}}, walls: {{}}}}"
    overrides = (f"master.engage={{button: {engage}}}", f"master.mapping={mapping}", "codec.position.step_m=1e-5")
    loaded = configuration(*overrides, device=WithButtons)
    with pytest.raises(ConfigurationError, match="button") if is_refused else nullcontext():
        build_simulation(loaded)


@pytest.mark.parametrize(
    ("text", "place", "told"),
    [
        ("", "", "empty"),
        ("axes: x", "", "link"),
        ("- 1", "", "mapping"),
        (MINIMAL + "rate_hz: 500\nrate_hz: 600\n", ":3:1: ", "rate_hz"),
        ("? [a, b]\n: 1", "", "key"),
        ("codec: 5\n" + MINIMAL, "", "codec"),
        ("link: {security: none}", "", "loopback"),
        ("rate_hz: 500\nmaster:\n\tdevice: {driver: operator}\n", ":3:1: ", "tab"),
        ("# mine\naxes: xyz\nrate_hz:500\n\nlink: {}\n", ":3:9: ", '"rate_hz:"'),
        ("link:\n  listen: 127.0.0.1:0\n  silence_ms:200\n", ":3:14: ", '"silence_ms:"'),
        ('link: {silence_ms:200, listen: "127.0.0.1:0"}\n', ":1:8: ", '"silence_ms:"'),
        ("slave:\n  scene:\n    - shape:plane\n      stiffness_n_m: 1\n", ":3:13: ", '"shape:"'),
        ("axes: xyz\nrate_hz 500\nlink: {}\n", ":2:1: ", ""),
        ("link: {silence_ms: 200\naxes: xyz\n", ":2:5: ", "}"),
        ("axes: @x\n", ":1:7: ", "@"),
    ],
)
def test_what_is_no_configuration_is_one_line_with_the_place_of_a_slip(
    tmp_path: Path, text: str, place: str, told: str
) -> None:
    path = write(tmp_path, text)
    message = refusal(path)
    assert message.startswith(f"{path}{place}") and told in message


def test_a_file_that_is_not_there_or_not_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "none.yaml", tmp_path / "binary.yaml", tmp_path):
        assert str(path) in refusal(path)


# --- accepted


def test_a_key_may_have_another_name_in_the_file_than_in_python() -> None:
    model = create_model("Renamed", __base__=Options, start=(float, Field(alias="from")))
    assert dict(validated(model, {"from": 1})) == {"start": 1.0}
    with pytest.raises(ConfigurationError, match="to: unknown key"):
        validated(model, {"from": 1, "to": 2})


def test_a_minimal_file_is_complete_and_overrides_reach_into_it(tmp_path: Path) -> None:
    assert load(write(tmp_path, MINIMAL)).system.slave.scene == ()
    path = write(tmp_path, MINIMAL + PLANE)
    overrides = ["codec.force={weber: 0.2, reference: sent}", "slave.scene.0.stiffness_n_m=700"]
    overrides += ["link.emulate.delay_ms=3", "rate_hz=500"]
    before, after = load(path).system, load(path, overrides).system
    assert (before.codec.force.weber, after.codec.force.weber) == (0.1, 0.2)
    assert (before.slave.scene[0].stiffness_n_m, after.slave.scene[0].stiffness_n_m) == (500, 700)
    assert before.link.emulate is None and after.link.emulate is not None
    assert (after.link.emulate.delay_ms, before.tick_period, after.tick_period) == (3, 0.001, 0.002)
    made = streams(after)[1][0].deadband
    assert isinstance(made, ForceDeadband) and (made.weber, made.floor, made.reference) == (0.2, 0.02, "sent")


@pytest.mark.parametrize("file", sorted(path.name for path in CONFIGS.glob("*.yaml")))
def test_a_shipped_file_comes_back_from_its_own_document(file: str) -> None:
    system = load(CONFIGS / file).system
    text = yaml.safe_dump(system.model_dump(mode="json"))
    assert System.model_validate(yaml.safe_load(text)).model_dump() == system.model_dump()


def test_paths_are_relative_to_the_file_and_in_overrides_to_the_working_directory(tmp_path: Path) -> None:
    path = write(tmp_path, "link: {key_file: keys/here}")
    assert load(path).system.link.key_file == tmp_path / "keys/here"
    assert load(path, ["link.key_file=there"]).system.link.key_file == Path.cwd() / "there"
    replaying = write(tmp_path, MINIMAL + "master: {device: {driver: replay, trace: a.csv}}")
    for overrides, expected in ((), tmp_path / "a.csv"), (("master.device.trace=b.csv",), Path.cwd() / "b.csv"):
        device = load(replaying, overrides).device
        assert device is not None and device.options.trace == expected  # type: ignore[attr-defined]


UNITS = (
    "_kg", "_kg_m2", "_n", "_nm", "_n_m", "_n_m_rad", "_n_s", "_n_s_m", "_nm_s", "_n_m_s_rad", "_hz", "_m_s", "_rad_s",
    "_j",
)  # fmt: skip


def unbounded(node: Any, path: tuple[str, ...] = ()) -> Iterator[str]:
    """Numbers with a mechanical unit in their name that lack a lowest or a highest value, in a JSON schema."""
    if isinstance(node, list):
        for entry in node:
            yield from unbounded(entry, path)
    elif isinstance(node, dict):
        if node.get("type") in ("number", "integer") and path[-1].endswith(UNITS):
            low, high = ("minimum", "exclusiveMinimum"), ("maximum", "exclusiveMaximum")
            if not (any(map(node.__contains__, low)) and any(map(node.__contains__, high))):
                yield ".".join(path)
        for name, entry in node.items():
            in_it = path if name in ("anyOf", "oneOf", "items", "prefixItems", "properties", "$defs") else (*path, name)
            yield from unbounded(entry, in_it)


def test_every_number_with_a_mechanical_unit_has_a_range() -> None:
    schema = json.loads((CONFIGS / "weberlink.schema.json").read_text())
    assert list(unbounded(schema)) == []
    assert list(unbounded({"properties": {"mass_kg": {"anyOf": [{"type": "number", "minimum": 0}]}}})) == ["mass_kg"]


# --- hardware, and the two hosts


def test_a_host_checks_the_driver_of_its_own_side_only(tmp_path: Path) -> None:
    path = write(tmp_path, "link: {key_file: k}\nslave: {robot: {driver: not_installed_here}}")
    loaded = load(path, sides=[MASTER])
    assert loaded.device is not None and loaded.robot is None
    assert "not_installed_here" in refusal(path, sides=[SLAVE])


@pytest.mark.parametrize(("side", "part"), [(MASTER, "device"), (SLAVE, "robot")])
@pytest.mark.parametrize(("says", "is_refused"), [("", True), ("    COMPUTED = True\n", False)])
def test_driver_of_another_package_is_hardware_unless_it_says_otherwise(
    side: str, part: str, says: str, is_refused: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"{'silent' if is_refused else 'computed'}_{part}"
    source = f"from pydantic import BaseModel\nclass Thing:\n{says}    class Options(BaseModel): pass\n"
    install(tmp_path, name, {f"{name}_thing": source}, f"[weberlink.{part}s]\n{name} = {name}_thing:Thing\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    path = write(tmp_path, MINIMAL + f"{side}: {{{part}: {{driver: {name}}}}}")
    assert "polhem_serial" in refusal(path, "master.device={driver: polhem_serial}", sides=[MASTER])
    for sides in ([side], [MASTER, SLAVE]):
        if is_refused:
            assert "link.security" in refusal(path, sides=sides)
            load(path, ["link.security=session"], sides=sides)
        else:
            load(path, sides=sides)


def test_a_session_key_is_for_a_run_of_both_sides(tmp_path: Path) -> None:
    path = write(tmp_path, "link: {listen: 127.0.0.1:1, slave: 127.0.0.1:1, security: session}")
    dry_run(load(path))
    assert "link.security" in refusal(path, sides=[SLAVE])
    assert "loopback" in refusal(path, "link.slave=10.0.0.2:1")
