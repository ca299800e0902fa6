"""The table of predictors. A new one is a file beside these and a line here.

`hybrid` and `adaptive` are not predictors of their own: they are banks of several of these with the choice made at
every send, as the paper does it (see `codec.encoder`) or by their record (see `codec.adaptive`). Naming a single
predictor is a bank of one.
"""

from weberlink.codec.predictors.affine import AFFINE
from weberlink.codec.predictors.contract import Model, Parametric, Predictor, Trust
from weberlink.codec.predictors.linear import LINEAR
from weberlink.codec.predictors.plane import PLANE
from weberlink.codec.predictors.sphere import SPHERE
from weberlink.codec.predictors.surface import SURFACE
from weberlink.codec.predictors.trend import TREND
from weberlink.codec.predictors.zoh import ZOH

FITTED: dict[str, Predictor] = {
    "zoh": ZOH,
    "linear": LINEAR,
    "plane": PLANE,
    "sphere": SPHERE,
}
"""The paper's, by name, in the order in which a hybrid breaks ties: the simplest first."""

PARAMETRIC: dict[str, Parametric] = {
    "trend": TREND,
    "affine": AFFINE,
    "surface": SURFACE,
}

PREDICTORS: dict[str, Predictor | Parametric] = {**FITTED, **PARAMETRIC}

HYBRID = "hybrid"
ADAPTIVE = "adaptive"
BANKS = (HYBRID, ADAPTIVE)
"""What stands for several, in place of the name of one."""

HYBRID_BANK = ("zoh", "linear", "plane", "sphere")
ADAPTIVE_BANK = ("plane", "surface", "affine", "trend", "zoh")
"""What each chooses among where nothing else is said; of equals the first."""

__all__ = [
    "ADAPTIVE",
    "ADAPTIVE_BANK",
    "BANKS",
    "FITTED",
    "HYBRID",
    "HYBRID_BANK",
    "PARAMETRIC",
    "PREDICTORS",
    "Model",
    "Parametric",
    "Predictor",
    "Trust",
]
