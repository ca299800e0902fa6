"""The dialog on a terminal, sample rates, and the command `device test`."""

import io
import os
import re
import signal
import threading

import pytest

from plugins.doctor.tests.device.people import Clock, sitting
from tests.session.systems import CONFIGS
from weberlink.cli.output import CommandError
from weberlink.config import ConfigurationError
from weberlink.installation import install_line
from weberlink_doctor.device.commissioning import run, uninterrupted

FILE = CONFIGS / "loopback.yaml"


def test_ctrl_c_waits_while_a_device_is_made_safe() -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        os.kill(os.getpid(), signal.SIGINT)
        done.append("main")

    def safely() -> None:
        with uninterrupted():  # which signals never reach
            done.append("other thread")

    thread = threading.Thread(target=safely)
    thread.start()
    thread.join()
    assert done == ["main", "other thread"]


@pytest.mark.parametrize(
    ("name", "overrides", "lines", "parts"),
    [
        (
            "operator",
            ["force_n=2.5", "master.device.workspace_m=0.05"],
            ["", "yes", *["", "y"] * 3],
            ["at most 2.5 N", "The force is right"],
        ),
        ("point", [], ["", "yes"], ["The motion is right"]),
    ],
)
def test_simulated_part_passes_with_overrides_of_the_file(
    name: str, overrides: list[str], lines: list[str], parts: list[str]
) -> None:
    screen = io.StringIO()
    run(name, sitting(Clock(), screen, *lines)[0], FILE, overrides)
    assert [part for part in parts if part not in screen.getvalue()] == []
    with pytest.raises(CommandError, match=f"^{name}: stopped before the end"):
        run(name, sitting(Clock(), io.StringIO(), "")[0], None, [])


def test_driver_of_a_guest_that_is_not_installed_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("weberlink.installation._installed", lambda *_: {})
    with pytest.raises(ConfigurationError, match=f"driver 'touch' .* {re.escape(install_line('devices'))}"):
        run("touch", sitting(Clock(), io.StringIO())[0])
