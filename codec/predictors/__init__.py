"""The table of predictors.

To add one, write a file in this folder and a line here, or an entry point of the group `weberlink.predictors`.

`hybrid` and `adaptive` are not predictors: at every send they choose one of a bank of several, by the paper's rule
(`weberlink.codec.encoder`) or by how often each would have sent (`weberlink.codec.adaptive`).
"""

from collections.abc import Iterable
from typing import Any

from weberlink.codec.predictors.contract import EstimatedPredictor, FittedPredictor, Predictor
from weberlink.codec.predictors.model import FitLimits, Model
from weberlink.registry import Registry


def _check(name: str, entry: Any) -> None:
    if not isinstance(entry, FittedPredictor | EstimatedPredictor) or entry.name != name:
        raise ValueError(f"predictor {name!r}: its entry point must name a Predictor object called {name!r}")


_HERE = "weberlink.codec.predictors"
PREDICTORS: Registry[Predictor] = Registry(
    "predictor",
    {
        "zoh": f"{_HERE}.zoh:ZOH",
        "linear": f"{_HERE}.linear:LINEAR",
        "plane": f"{_HERE}.plane:PLANE",
        "sphere": f"{_HERE}.sphere:SPHERE",
        "affine": f"{_HERE}.affine:AFFINE",
        "surface": f"{_HERE}.surface:SURFACE",
        "path": f"{_HERE}.path:PATH",
        "elastic": f"{_HERE}.path:ELASTIC",
    },
    "weberlink.predictors",
    _check,
)
"""By name, the paper's four first."""

HYBRID = "hybrid"
ADAPTIVE = "adaptive"
BANKS = (HYBRID, ADAPTIVE)  # Names that stand for a choice among several predictors

HYBRID_BANK = ("zoh", "linear", "plane", "sphere")
ADAPTIVE_BANK = ("plane", "sphere", "surface", "affine", "path", "elastic", "linear", "zoh")
"""The default banks. Of equally good predictors, the first in the bank is chosen: `adaptive` begins with contacts, for
all are equally good before the first force."""


def suits(name: str, signal: str) -> bool:
    """Whether a predictor may code a signal: "force", "torque", "position" or "joints"."""
    predictor = PREDICTORS[name]
    if signal == "torque":
        return not predictor.describes_contact
    if signal in ("position", "joints") and predictor.geometric:  # nothing travels beside the value
        return False
    return signal != "joints" or not predictor.estimated  # the update of an arm carries no parameters


def unfit_for_hybrid(bank: Iterable[str]) -> list[str]:
    """Those of a bank among which `hybrid` cannot choose, as it sends no parameters."""
    return [name for name in bank if name not in HYBRID_BANK and PREDICTORS[name].estimated]


__all__ = [
    "ADAPTIVE",
    "ADAPTIVE_BANK",
    "BANKS",
    "HYBRID",
    "HYBRID_BANK",
    "PREDICTORS",
    "EstimatedPredictor",
    "FitLimits",
    "FittedPredictor",
    "Model",
    "Predictor",
    "suits",
    "unfit_for_hybrid",
]
