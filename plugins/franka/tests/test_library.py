"""The stand-in has the names and arguments of the real `pylibfranka`, where that is installed."""

import inspect
import re
from typing import Any

import pytest

from plugins.franka.tests import library

real: Any = pytest.importorskip("pylibfranka", reason="needs the extra franka")

CLASSES = [
    library.ActiveControlBase,
    library.Duration,
    library.Errors,
    library.Model,
    library.RealtimeConfig,
    library.Robot,
    library.RobotMode,
    library.RobotState,
    library.Torques,
]


def public(names: Any) -> set[str]:
    return {name for name in names if not name.startswith("_")}


@pytest.mark.parametrize("stand_in", CLASSES, ids=lambda each: each.__name__)
def test_every_name_is_in_the_library(stand_in: type) -> None:
    own = {"is_cut", "names"}
    states = {library.Torques: library.Torques([0.0] * 7), library.RobotState: library.RobotState(library.Arm("arm"))}
    names = public(vars(stand_in)) | public(vars(states.get(stand_in, object)))
    assert names - own <= public(dir(getattr(real, stand_in.__name__)))


@pytest.mark.parametrize("stand_in", CLASSES, ids=lambda each: each.__name__)
def test_every_method_takes_what_the_library_takes(stand_in: type) -> None:
    theirs = getattr(real, stand_in.__name__)
    for name, method in vars(stand_in).items():
        if not inspect.isfunction(method) or (name.startswith("_") and stand_in is not library.Robot):
            continue
        ours = list(inspect.signature(method).parameters)
        text, nested = re.sub(r"<[^>]*>", "", getattr(theirs, name).__doc__ or ""), 1
        while nested:  # the parameters of types
            text, nested = re.subn(r"\[[^\[\]]*\]", "", text)
        known = [re.findall(r"(\w+): ", arguments) for arguments in re.findall(rf"{name}\(([^)]*)\)", text)]
        assert ours in known, f"{name}: {ours}, not {known}"
