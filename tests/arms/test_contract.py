"""The kernel's leader arm keeps the contract."""

from collections.abc import Iterator
from typing import Any

import pytest

from weberlink.master.devices import leaders
from weberlink.master.devices.remote_leader import RemoteLeader
from weberlink.master.devices.target_link import LeaderTarget
from weberlink.slave.robots import followers
from weberlink.testing.arms import ArmBench, LeaderContract
from weberlink.testing.time import TICK, virtual_time

OPTIONS: dict[str, Any] = {
    "joints": ("pan", "lift"), "gripper": True, "lower_rad": (-1.0, -1.5, 0.0), "upper_rad": (1.0, 1.5, 1.2)
}  # fmt: skip


def made(**options: Any) -> RemoteLeader:
    return RemoteLeader(RemoteLeader.Options.model_validate(OPTIONS | options), TICK, Program())


def test_every_built_in_driver_is_tried() -> None:
    assert [*leaders.BUILT_IN, *followers.BUILT_IN] == ["remote_leader"]


class Program:
    """Leads a remote leader, a milliradian a tick."""

    def open(self) -> None:
        self.angle = 0.0

    def newest(self) -> LeaderTarget:
        self.angle = min(0.3, self.angle + 1e-3)
        return LeaderTarget((self.angle, 0.0, 0.0), True, 1)

    def close(self) -> None: ...


class TestRemoteLeader(LeaderContract):
    @pytest.fixture
    def bench(self) -> Iterator[ArmBench]:
        yield ArmBench(made(), virtual_time())

    def test_it_displays_nothing_and_has_a_button(self) -> None:
        spec = made().spec
        assert (spec.force_feedback, spec.buttons, spec.calibrated) == (False, 1, True)


def test_home_is_within_the_range() -> None:
    made(home_rad=(0.0, 1.5, 1.2))
    for home in ((0.0, 1.6, 0.0), (0.0, -1.6, 0.0)):
        with pytest.raises(ValueError, match="home_rad"):
            made(home_rad=home)
