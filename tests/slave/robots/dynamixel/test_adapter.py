"""What the kernel says of an adapter's latency, and the line that sets it right."""

from pathlib import Path

import pytest

from weberlink.slave.robots.dynamixel.bus import USB, latency_advice, latency_ms


@pytest.fixture
def sysfs(tmp_path: Path) -> Path:
    for name, text in (("ttyUSB0", "16\n"), ("ttyUSB1", "1\n"), ("ttyUSB2", "soon\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "latency_timer").write_text(text)
    return tmp_path


def test_a_slow_adapter_comes_with_the_command_that_sets_it_right(sysfs: Path) -> None:
    assert latency_ms("/dev/ttyUSB0", sysfs) == 16
    advice = latency_advice("/dev/ttyUSB0", sysfs)
    assert advice is not None
    assert "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer" in advice
    assert "49-weberlink.rules" in advice
    assert "\n" not in advice


@pytest.mark.parametrize("port", ["/dev/ttyUSB1", "/dev/ttyUSB2", "/dev/ttyUSB3", "/dev/ttyACM0", "/dev/pts/3"])
def test_no_advice_without_need(port: str, sysfs: Path) -> None:
    assert latency_advice(port, sysfs) is None


def test_a_link_leads_to_the_adapter(sysfs: Path, tmp_path: Path) -> None:
    (tmp_path / "arm").symlink_to("/dev/ttyUSB0")
    assert latency_ms(str(tmp_path / "arm"), sysfs) == 16


def test_the_adapter_of_the_vendor_is_known() -> None:
    assert any(id_.matches(0x0403, 0x6014) for id_ in USB)
    assert not any(id_.matches(0x1A86, 0x7523) for id_ in USB)
