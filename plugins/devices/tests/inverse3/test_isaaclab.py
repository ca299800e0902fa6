"""Isaac Lab's client of the Inverse Service at the emulated one, where both are installed: `make isaaclab`."""

import pytest

from trials.devices import isaaclab


@pytest.mark.realtime
@pytest.mark.parametrize("service", ["3.5", "3.1"])
def test_isaaclab_client_works_and_its_force_adds(service: str) -> None:
    lacking = isaaclab.missing()
    if lacking is not None:
        pytest.skip(f"{lacking} is not installed; make isaaclab runs this")
    assert "another program adds to it" in isaaclab.run(service)
