"""Advice of a rate that the machine can hardly hold, and addresses that nobody has."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.system.systems import CONFIGS, configuration
from weberlink.protocol.keys import generate
from weberlink.system.advice import TICK_SHARE, USUAL_RATE_HZ, Parts, placeholders, tick_rate
from weberlink.system.configuration import SLAVE, Configuration, load
from weberlink.system.tick_cost import measured_tick_s


def at_rate(rate_hz: float) -> Configuration:
    return configuration(f"rate_hz={rate_hz:g}")


@pytest.mark.parametrize("tick_us", [40.0, 90.0, 500.0])
def test_rate_beyond_the_machine_names_one_that_it_holds(tick_us: float) -> None:
    (line,) = tick_rate(Parts(at_rate(10_000.0)), lambda _: 1e-6 * tick_us)
    assert line.startswith("rate_hz 10000: ")
    most = float(line.rpartition(" ")[2])
    assert 100.0 <= most < 10_000.0
    assert most == pytest.approx(TICK_SHARE / (1e-6 * tick_us), abs=100.0)
    assert list(tick_rate(Parts(at_rate(most)), lambda _: 1e-6 * tick_us)) == []


def test_rate_that_the_machine_holds_needs_no_word() -> None:
    assert list(tick_rate(Parts(at_rate(10_000.0)), lambda _: 1e-6)) == []
    assert list(tick_rate(Parts(at_rate(10_000.0)), lambda _: None)) == []
    measured: list[Configuration] = []
    assert list(tick_rate(Parts(at_rate(USUAL_RATE_HZ)), measured.append)) == []
    assert measured == [], "a usual rate costs nothing"


@pytest.mark.parametrize("file", ["loopback.yaml", "delay.yaml", "phantom-arm.yaml", "ros2.yaml", "koch-so101.yaml"])
def test_a_tick_is_measured_with_stand_ins_for_hardware(file: str, tmp_path: Path) -> None:
    """It is more than what the codec takes, and far less than a person would wait."""
    key = tmp_path / "key"
    generate(key)
    took = measured_tick_s(load(CONFIGS / file, ["rate_hz=10000", f"link.key_file={key}"]))
    assert took is not None
    assert 2e-6 < took < 0.05


def test_address_of_the_slave_that_nobody_has_is_named() -> None:
    lan = load(CONFIGS / "lan.yaml")
    (line,) = placeholders(Parts(lan))
    assert line.startswith("link.slave 192.0.2.1:47000: ")
    for mine in ("robot:47000", "10.0.0.2:47000", '"[2001:db9::1]:47000"'):
        assert list(placeholders(Parts(load(CONFIGS / "lan.yaml", [f"link.slave={mine}"])))) == []
    (line,) = placeholders(Parts(load(CONFIGS / "lan.yaml", ['link.slave="[2001:db8::1]:47000"'])))
    assert line.startswith("link.slave [2001:db8::1]:47000: ")
    assert list(placeholders(Parts(load(CONFIGS / "lan.yaml", sides=[SLAVE])))) == [], "the robot's host calls nobody"
    # A path that is found has no address of the file.
    found = lan.system.link.model_copy(update={"path": "ice"})
    assert list(placeholders(Parts(replace(lan, system=lan.system.model_copy(update={"link": found}))))) == []


def test_address_of_a_device_that_nobody_has_is_named() -> None:
    """Every driver says by its own options where its device is."""
    for port, count in (("ws://192.0.2.1:10001", 1), ("ws://192.0.2.1:10001#A7", 1), ("ws://localhost:10001", 0)):
        device = f'master.device={{driver: inverse3, port: "{port}"}}'
        found = list(placeholders(Parts(configuration(device, "link.security=session"))))
        assert [line.partition(": ")[0] for line in found] == [f"master.device.port {port}"] * count
