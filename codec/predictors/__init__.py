"""The table of predictors.

To add one, write a file in this folder and a line here, or an entry point of the group `weberlink.predictors`.

`hybrid` is none: it chooses among several (`weberlink.codec.choice`).
"""

from typing import Any

from weberlink.codec.predictors.contract import EstimatedPredictor, FitLimits, FittedPredictor, Model, Predictor
from weberlink.registry import Registry


def _check(name: str, entry: Any) -> None:
    if not isinstance(entry, FittedPredictor | EstimatedPredictor) or entry.name != name:
        raise ValueError(f"predictor {name!r}: its entry point must name a Predictor object called {name!r}")


_HERE = "weberlink.codec.predictors"
PREDICTORS: Registry[Predictor] = Registry(
    "predictor",
    {
        "zoh": f"{_HERE}.signal_based:ZOH",
        "linear": f"{_HERE}.signal_based:LINEAR",
        "plane": f"{_HERE}.geometry_based:PLANE",
        "sphere": f"{_HERE}.geometry_based:SPHERE",
    },
    "weberlink.predictors",
    _check,
)
"""By name, the paper's four first."""


def suits(name: str, signal: str) -> bool:
    """Whether a predictor may code a signal: "force", "torque", "position" or "joints"."""
    predictor = PREDICTORS[name]
    if signal == "torque":
        return not predictor.describes_contact
    if signal in ("position", "joints") and predictor.geometric:  # nothing travels beside the value
        return False
    return signal != "joints" or not predictor.estimated  # the update of an arm carries no parameters


__all__ = ["PREDICTORS", "EstimatedPredictor", "FitLimits", "FittedPredictor", "Model", "Predictor", "suits"]
