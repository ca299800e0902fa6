"""A driver whose force stays on when its host stops is refused, unless the file accepts it by name."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from tests.session.kinds import Kind, each_kind
from tests.session.systems import system
from weberlink.config import ConfigurationError
from weberlink.master.devices.contract import DeviceSpec
from weberlink.session.composition.master import check_force_ends

BOX = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("spec", "guarded", "accepted", "is_refused"),
    [
        ({}, False, None, True),
        ({}, False, "paddle", True),
        ({}, False, "pusher", False),
        ({"watchdog_s": 0.5}, False, None, False),
        ({}, True, None, False),
        ({"force_feedback": False}, False, None, False),
    ],
)
def test_a_driver_ends_its_force_or_is_accepted_by_name(
    spec: dict[str, Any], guarded: bool, accepted: str | None, is_refused: bool
) -> None:
    made = DeviceSpec("pusher", "xyz", 3.0, 500.0, BOX, 1000.0, **{"force_feedback": True} | spec)
    device: Any = SimpleNamespace(spec=made, guarded=guarded)
    if not is_refused:
        check_force_ends(device, "pusher", accepted)
        return
    with pytest.raises(ConfigurationError, match=r"master\.device: .*set master\.accept_no_watchdog: pusher") as caught:
        check_force_ends(device, "pusher", accepted)
    assert "\n" not in str(caught.value)


@each_kind
def test_a_side_with_such_a_driver_is_not_built(kind: Kind) -> None:
    class Unguarded(kind.device):  # type: ignore[misc, name-defined]
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            self.spec = replace(self.spec, watchdog_s=None)

    with pytest.raises(ConfigurationError, match=r"set master\.accept_no_watchdog"):
        system(*kind.overrides, file=kind.file, device=Unguarded)
