"""Bad input to a configuration: one line each that names the file, the field and what was expected."""

from pathlib import Path
from typing import Any

import pytest

from weberlink.master import devices
from weberlink.slave import robots
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
        ("", "is empty; start from one of the files of configs/"),
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


@pytest.mark.parametrize("table", [devices, robots])
def test_every_driver_that_can_be_plugged_in_counts_as_hardware(table: Any) -> None:
    computed = {name for name in table.BUILT_IN if not hasattr(table.load(name), "plugged")}
    assert computed == table.COMPUTED
    assert table.is_hardware("of another package")


def test_a_session_key_is_for_a_run_of_both_sides(tmp_path: Path) -> None:
    path = write(tmp_path, "link: {listen: 127.0.0.1:1, slave: 127.0.0.1:1, security: session}")
    assert advise(try_out(load(path))) == []
    with pytest.raises(ConfigurationError, match=r"link.security: session is for weberlink loopback"):
        try_out(load(path, sides=[SLAVE]))
    with pytest.raises(ConfigurationError, match="loopback addresses only"):
        load(path, ["link.slave=10.0.0.2:1"])
