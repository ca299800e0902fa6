"""Bad input to a configuration: one line each that names the file, the field and what was expected."""

from pathlib import Path
from typing import Any

import pytest

from tests.system.packages import install
from weberlink.master import devices
from weberlink.master.devices import leaders
from weberlink.registry import is_hardware
from weberlink.slave import robots
from weberlink.slave.robots import followers
from weberlink.system.advice import advise
from weberlink.system.composition.trial import try_out
from weberlink.system.configuration import MASTER, SLAVE, ConfigurationError, load

MINIMAL = "link: {listen: 127.0.0.1:0, slave: 127.0.0.1:0, security: none}\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "system.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def complaint(path: Path, *overrides: str) -> str:
    with pytest.raises(ConfigurationError) as caught:
        load(path, overrides)
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_a_minimal_file_is_complete(tmp_path: Path) -> None:
    configuration = load(write(tmp_path, MINIMAL))
    assert configuration.system.codec.force.weber == 0.10
    assert configuration.system.slave.scene == ()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("codec: {force: {webber: 0.1}}", "codec.force.webber: unknown key; did you mean weber?"),
        ("codek: {}", "codek: unknown key; did you mean codec?"),
        ("codec: {force: {weber: ten}}", "codec.force.weber"),
        ("codec: {force: {weber: -0.1}}", "codec.force.weber: should be greater than or equal to 0, not -0.1"),
        ("codec: {force: {weber: .nan}}", "codec.force.weber: should be a finite number"),
        ("codec: {force: {predictor: spline}}", "codec.force.predictor"),
        ("codec: {force: {bank: [zoh, zoh]}}", "codec.force.bank: names each predictor once"),
        ("codec: {position: {predictor: plane}}", "codec.position.predictor"),
        ("rate_hz: 0", "rate_hz"),
        ("axes: zx", "axes"),
        ("control: {scheme: magic}", "control.scheme"),
        ("master: {device: {driver: operater}}", "driver: no device is called 'operater'; nearest is 'operator'"),
        ("master: {device: {driver: operator, tremour_m: 0}}", "device.tremour_m: unknown key; did you mean tremor_m?"),
        ("master: {device: {driver: operator, tremor_m: -1}}", "master.device.tremor_m"),
        ("slave: {robot: {driver: simulated, mass_kg: 0}}", "slave.robot.mass_kg"),
        ("slave: {scene: [{shape: plane}]}", "slave.scene.0.stiffness_n_m: is missing"),
        ("slave: {scene: [{shape: torus}]}", "slave.scene.0"),
        (
            "slave: {scene: [{shape: plane, stiffness_n_m: 500, frictoin: {static: 1, dynamic: 1}}]}",
            "frictoin: unknown key; did you mean friction?",
        ),
        ("slave: {limits: {workspace_m: [[0, 1], [1, 0], [0, 1]]}}", "slave.limits.workspace_m: y must rise"),
        ("realtime: {priority: 99}", "realtime.priority"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_named_with_its_path(tmp_path: Path, text: str, expected: str) -> None:
    message = complaint(write(tmp_path, MINIMAL + text))
    assert message.startswith(str(tmp_path / "system.yaml"))
    assert expected in message


@pytest.mark.parametrize(
    ("link", "expected"),
    [
        ("{}", "security psk needs key_file; make one with: weberlink keygen"),
        ("{security: none, slave: 10.0.0.2:47000, listen: 127.0.0.1:1}", "loopback addresses only"),
        ("{security: none}", "loopback addresses only"),
        ("{key_file: k, slave: nowhere}", "link.slave: must be host:port, not 'nowhere'"),
        ("{key_file: k, slave: 'host:99999'}", "link.slave: must be host:port"),
        ("{key_file: k, silence_ms: 1}", "link.silence_ms"),
        ("{key_file: k, emulate: {loss: 1.5}}", "link.emulate.loss"),
    ],
)
def test_a_wrong_link_is_named(tmp_path: Path, link: str, expected: str) -> None:
    assert expected in complaint(write(tmp_path, f"link: {link}"))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "is empty; start from a shipped file"),
        ("axes: x", "link: is missing"),
        ("- 1", "must be a mapping"),
        ("link: [", "not YAML"),
        ("link: {}\nlink: {}", "is given twice"),
        ("? [a, b]\n: 1", "unhashable key"),
        ("codec: 5\n" + MINIMAL, "codec"),
    ],
)
def test_what_is_no_configuration_is_said_to_be_none(tmp_path: Path, text: str, expected: str) -> None:
    assert expected in complaint(write(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "line", "column", "told"),
    [
        ("rate_hz: 500\nmaster:\n\tdevice: {driver: operator}\n", 3, 1, "tab"),
        ("master:\n  device:\n  \tdriver: operator\n", 3, 3, "tab"),
        ("rate_hz:500\naxes: xyz\n", 1, 9, '"rate_hz:"'),
        ("rate_hz:500\n", 1, 9, '"rate_hz:"'),
        ("# mine\naxes: xyz\nrate_hz:500\n\nlink: {}\n", 3, 9, '"rate_hz:"'),
        ("link:\n  silence_ms:200\n  listen: 127.0.0.1:0\n", 2, 14, '"silence_ms:"'),
        ("link:\n  listen: 127.0.0.1:0\n  silence_ms:200\n", 3, 14, '"silence_ms:"'),
        ('link: {silence_ms:200, listen: "127.0.0.1:0"}\n', 1, 8, '"silence_ms:"'),
        ("slave:\n  scene:\n    - shape:plane\n      stiffness_n_m: 1\n", 3, 13, '"shape:"'),
        ("axes: xyz\nrate_hz 500\nlink: {}\n", 2, 1, "key: value"),
        ("link: {silence_ms: 200\naxes: xyz\n", 2, 5, "}"),
        ("link:\n   silence_ms: 200\n  listen: x\n", 3, 3, "indented"),
        ("axes: @x\n", 1, 7, "@"),
    ],
)
def test_a_slip_in_yaml_has_its_place_and_plain_words(
    tmp_path: Path, text: str, line: int, column: int, told: str
) -> None:
    path = write(tmp_path, text)
    said = complaint(path)
    assert said.startswith(f"{path}:{line}:{column}: ")
    assert told in said
    assert not any(word in said for word in ("token", "mapping values", "block", "could not find"))


def test_a_space_is_missed_in_a_value_and_in_an_override(tmp_path: Path) -> None:
    assert '"silence_ms:"' in complaint(write(tmp_path, "link:\n  silence_ms:200\n"))
    assert '"silence_ms:"' in complaint(write(tmp_path, MINIMAL), "link={silence_ms:200}")


def test_a_colon_in_a_value_and_a_tab_behind_one_are_no_slips(tmp_path: Path) -> None:
    system = load(write(tmp_path, 'link:\t{listen: robot:47000, slave: "robot:47000",\tkey_file: key}\n')).system
    assert (system.link.listen, system.link.slave) == ("robot:47000", "robot:47000")


def test_a_file_that_is_not_there_or_not_text(tmp_path: Path) -> None:
    assert "no such file" in complaint(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    assert "cannot be read" in complaint(tmp_path / "binary.yaml")
    assert "cannot be read" in complaint(tmp_path)


def test_overrides_reach_into_mappings_and_lists_and_make_what_is_missing(tmp_path: Path) -> None:
    path = write(tmp_path, MINIMAL + "slave: {scene: [{shape: plane, stiffness_n_m: 500}]}")
    system = load(
        path, ["codec.force.weber=0.2", "slave.scene.0.stiffness_n_m=700", "link.emulate.delay_ms=3", "rate_hz=500"]
    ).system
    assert system.codec.force.weber == 0.2
    assert system.slave.scene[0].stiffness_n_m == 700
    assert system.link.emulate is not None
    assert system.link.emulate.delay_ms == 3
    assert system.tick_period == 0.002


def test_one_direction_may_have_faults_of_its_own(tmp_path: Path) -> None:
    faults = "link.emulate={delay_ms: 3, loss: 0.1, to_slave: {delay_ms: 152, blackouts_s: [[1, 0.5], [2, 0.1, 0.2]]}}"
    emulate = load(write(tmp_path, MINIMAL), [faults]).system.link.emulate
    assert emulate is not None
    to_slave, to_master = emulate.directions
    assert (to_slave.delay_ms, to_slave.loss, to_slave.blackouts_s) == (152, 0.1, ((1, 0.5), (2, 0.1, 0.2)))
    assert (to_master.delay_ms, to_master.loss, to_master.blackouts_s) == (3, 0.1, ())


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("codec.force.weber", "must be path.to.key=value"),
        ("=1", "must be path.to.key=value"),
        ("link.slave.port=1", "link.slave is a value"),
        ("slave.scene.3.stiffness_n_m=1", "slave.scene has items 0 to 0"),
        ("codec.force.weber=[", "is not YAML"),
        ("codec.force.wieber=1", "did you mean weber?"),
    ],
)
def test_a_wrong_override_is_named(tmp_path: Path, override: str, expected: str) -> None:
    path = write(tmp_path, MINIMAL + "slave: {scene: [{shape: plane, stiffness_n_m: 500}]}")
    assert expected in complaint(path, override)


def test_paths_are_relative_to_the_file_and_in_overrides_to_the_working_directory(tmp_path: Path) -> None:
    path = write(tmp_path, "link: {key_file: keys/here}")
    assert load(path).system.link.key_file == tmp_path / "keys/here"
    assert load(path, ["link.key_file=there"]).system.link.key_file == Path.cwd() / "there"
    replaying = write(tmp_path, MINIMAL + "master: {device: {driver: replay, trace: a.csv}}")
    device = load(replaying).device
    assert device is not None
    assert device.options.trace == tmp_path / "a.csv"  # type: ignore[attr-defined]
    device = load(replaying, ["master.device.trace=b.csv"]).device
    assert device is not None
    assert device.options.trace == Path.cwd() / "b.csv"  # type: ignore[attr-defined]


def test_a_host_checks_the_driver_of_its_own_side_only(tmp_path: Path) -> None:
    path = write(tmp_path, "link: {key_file: k}\nslave: {robot: {driver: not_installed_here}}")
    configuration = load(path, sides=[MASTER])
    assert configuration.device is not None
    assert configuration.robot is None
    with pytest.raises(ConfigurationError, match="not_installed_here"):
        load(path, sides=[SLAVE])


@pytest.mark.parametrize("side", [MASTER, SLAVE])
@pytest.mark.parametrize(
    "hardware", ["master: {device: {driver: haply_2diy}}", "slave: {robot: {driver: dynamixel, baud: 1000000}}"]
)
def test_hardware_without_a_key_is_refused_on_either_end(tmp_path: Path, hardware: str, side: str) -> None:
    with pytest.raises(ConfigurationError, match=r"link.security: none .*weberlink keygen"):
        load(write(tmp_path, MINIMAL + hardware), sides=[side])
    load(tmp_path / "system.yaml", ["link.security=session"], sides=[side])


@pytest.mark.parametrize("table", [devices, robots, leaders, followers])
def test_drivers_that_can_be_plugged_in_are_the_hardware(table: Any) -> None:
    for name in table.BUILT_IN:
        driver = table.load(name)
        assert hasattr(driver, "plugged") is is_hardware(driver) is (name not in table.COMPUTED), name


def test_driver_that_cannot_be_imported_here_counts_as_hardware(tmp_path: Path) -> None:
    path = write(tmp_path, MINIMAL + "slave: {robot: {driver: of_another_package}}")
    with pytest.raises(ConfigurationError, match=r"link.security: none .*slave.robot of_another_package"):
        load(path, sides=[MASTER])


@pytest.mark.parametrize(
    ("name", "says", "is_refused"),
    [("silent", "", True), ("real", "    COMPUTED = False\n", True), ("computed", "    COMPUTED = True\n", False)],
)
def test_driver_of_another_package_is_hardware_unless_it_says_otherwise(
    name: str, says: str, is_refused: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = f"from pydantic import BaseModel\nclass Thing:\n{says}    class Options(BaseModel): pass\n"
    install(tmp_path, name, {f"{name}_thing": source}, f"[weberlink.devices]\n{name} = {name}_thing:Thing\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    path = write(tmp_path, MINIMAL + f"master: {{device: {{driver: {name}}}}}")
    if is_refused:
        with pytest.raises(ConfigurationError, match=rf"link.security: none .*master.device {name}"):
            load(path)
    else:
        load(path)


def test_a_session_key_is_for_a_run_of_both_sides(tmp_path: Path) -> None:
    path = write(tmp_path, "link: {listen: 127.0.0.1:1, slave: 127.0.0.1:1, security: session}")
    assert advise(try_out(load(path))) == []
    with pytest.raises(ConfigurationError, match=r"link.security: session is for weberlink loopback"):
        try_out(load(path, sides=[SLAVE]))
    with pytest.raises(ConfigurationError, match="loopback addresses only"):
        load(path, ["link.slave=10.0.0.2:1"])
