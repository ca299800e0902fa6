"""The shape of the force's deadband in a session, and the example of its page."""

import numpy as np
import pytest

from tests.session.kinds import HAND, run
from tests.session.systems import configuration
from weberlink.codec.deadband import DEADBANDS
from weberlink.protocol.states import State
from weberlink.session.composition.channels import measures_in


@pytest.mark.parametrize("shape", DEADBANDS)
def test_a_session_keeps_the_law_of_its_shape(shape: str) -> None:
    overrides = (
        f"codec.force.deadband={{shape: {shape}}}",
        "codec.force.predictor=zoh",
        "slave.scene=[{shape: plane, stiffness_n_m: 500}]",
    )
    system = configuration(*overrides).system
    measures = measures_in(system.model_dump(mode="json"))
    slave = run(HAND, 2.0, *overrides).slave
    counted = slave[(slave["state"] == State.ENGAGED.value) & (slave["ramping"] == 0)]
    held = counted[counted["sent"] == 0]
    pairs = zip(held["decoded"].tolist(), held["raw"].tolist(), strict=True)
    if measures is None:
        errors = np.linalg.norm(held["decoded"] - held["raw"], axis=1)
    else:
        error = measures(system.codec.force.weber)
        errors = np.array([error(tuple(one), tuple(other)) for one, other in pairs])
    assert (errors <= held["bound"]).all()
    assert counted["sent"].sum() > 0 and (np.linalg.norm(held["raw"], axis=1) > 0.0).sum() > 100
