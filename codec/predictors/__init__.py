"""The table of predictors. A new one is a file beside these and a line here.

`hybrid` is not a predictor of its own: it is a bank of several of these with the choice made at every send
(see `codec.encoder`), and naming a single predictor is a bank of one.
"""

from codec.predictors.contract import Model, Predictor, Trust
from codec.predictors.linear import LINEAR
from codec.predictors.plane import PLANE
from codec.predictors.sphere import SPHERE
from codec.predictors.zoh import ZOH

PREDICTORS: dict[str, Predictor] = {
    "zoh": ZOH,
    "linear": LINEAR,
    "plane": PLANE,
    "sphere": SPHERE,
}
"""By name, in the order in which a hybrid breaks ties: the simplest first."""

HYBRID = "hybrid"

__all__ = ["HYBRID", "PREDICTORS", "Model", "Predictor", "Trust"]
