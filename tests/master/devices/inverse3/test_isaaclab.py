"""Isaac Lab's client of the Inverse Service at the emulated one, where both are installed: `make isaaclab`."""

import pytest

from tests.master.devices.inverse3 import isaaclab_trial


@pytest.mark.realtime
@pytest.mark.parametrize("service", ["3.5", "3.1"])
def test_isaaclab_client_works_and_its_force_adds(service: str) -> None:
    lacking = isaaclab_trial.missing()
    if lacking is not None:
        pytest.skip(f"{lacking} is not installed; make isaaclab runs this")
    assert "another program adds to it" in isaaclab_trial.run(service)
