"""`adaptive` keeps up with the best of the paper's four on signals that no predictor models, whichever that is."""

import pytest

from tests.codec.law import sends
from tests.codec.synthetic import synthetic_names, synthetic_signal
from weberlink.codec import force_channel
from weberlink.codec.predictors import HYBRID_BANK

SECONDS = 2.0


@pytest.mark.parametrize(
    ("name", "per_s"),
    [*((name, 1000) for name in synthetic_names()), ("chirp", 4000), ("texture", 500)],
)
def test_it_sends_no_more_than_the_best_of_the_paper_s_four(name: str, per_s: int) -> None:
    """Within 5 % or five updates."""
    stream = synthetic_signal(name, 1, SECONDS, 1.0 / per_s)
    adaptive, *four = (
        sends(force_channel(predictor=predictor, tick_period=1.0 / per_s), stream)
        for predictor in ("adaptive", *HYBRID_BANK)
    )
    assert adaptive <= max(1.05 * min(four), min(four) + 5), dict(zip(HYBRID_BANK, four, strict=True))


def test_at_the_onset_of_a_contact_it_sends_no_more_than_a_plane() -> None:
    """All candidates are suspended then, so only their present errors tell which of them describes the contact."""
    depths = [1e-4 * max(0.0, tick - 100.5) for tick in range(180)]
    stream = [((0.0, 0.0, 500.0 * depth), (0.0, 0.0, -depth)) for depth in depths]
    adaptive, plane = (sends(force_channel(predictor=predictor), stream) for predictor in ("adaptive", "plane"))
    assert adaptive <= plane + 1
