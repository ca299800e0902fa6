"""The models that the maker's library drives, with what is published of each."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

ModelName = Literal[
    "omega.3", "omega.6", "omega.7", "delta.3", "sigma.3", "sigma.7", "lambda.3", "lambda.7", "novint_falcon"
]


@dataclass(frozen=True, slots=True)
class Model:
    """One model.

    Args:
        types: what `dhdGetSystemType` returns for it: one number, or those for the right and the left hand.
        force_n: largest force [N].
        reach_m: half an edge of the cube that holds all positions of the handle [m].
        torque_n_m: largest torque of the wrist [N m]; 0 for a passive wrist or none.
        orientation: whether it has a wrist with sensors.
        buttons: how many bits of `dhdGetButtonMask` are its buttons; most models have fewer.
    """

    types: tuple[int, ...]
    force_n: float
    reach_m: float
    torque_n_m: float = 0.0
    orientation: bool = False
    buttons: int = 8


MODELS: Mapping[ModelName, Model] = {
    "omega.3": Model((33,), 12.0, 0.12),
    "omega.6": Model((34, 36), 12.0, 0.12, orientation=True),
    "omega.7": Model((35, 37), 12.0, 0.12, orientation=True),
    "delta.3": Model((63,), 20.0, 0.24),
    "sigma.3": Model((206,), 12.0, 0.15),
    "sigma.7": Model((104, 105), 12.0, 0.15, torque_n_m=0.2, orientation=True),
    "lambda.3": Model((203,), 12.0, 0.2),
    "lambda.7": Model((108, 109), 12.0, 0.2, torque_n_m=0.2, orientation=True),
    "novint_falcon": Model((60,), 8.0, 0.08, buttons=4),
}
"""Numbers of the types: `forcedimension_core.constants.DeviceType` and the maker's dhdc.h.

Forces and torques: cDeltaDevice of CHAI3D; the reach is at least 1.6 of its radii of the workspace. It does not know
sigma.3 and the lambdas, which get the values of the sigma.7 and a cautious reach.
"""

assert tuple(MODELS) == get_args(ModelName)


def named(type_: int) -> ModelName | None:
    """The model of a type of the library; None for an unknown one."""
    return next((name for name, model in MODELS.items() if type_ in model.types), None)
