import pytest

from weberlink.codec import force_channel, position_channel
from weberlink.codec.predictors import ADAPTIVE_BANK, HYBRID_BANK, PARAMETRIC, PREDICTORS


def test_only_the_named_predictors_are_in_the_bank() -> None:
    assert force_channel(predictor="plane").bank == ("plane",)
    assert force_channel(bank=["zoh", "sphere"]).bank == ("zoh", "sphere")
    assert force_channel(predictor="linear").predictors == (PREDICTORS["linear"],)


@pytest.mark.parametrize("bank", [[], ["zoh", "zoh"], ["zoh", "spline"], ["hybrid"]])
def test_refuses_a_bank_that_is_none(bank: list[str]) -> None:
    with pytest.raises(ValueError, match="bank"):
        force_channel(bank=bank)


@pytest.mark.parametrize("predictor", ["plane", "sphere", "affine", "surface"])
def test_geometry_does_not_predict_positions(predictor: str) -> None:
    with pytest.raises(ValueError, match=predictor):
        position_channel(predictor=predictor)


@pytest.mark.parametrize(("axes", "force_levels", "position_levels"), [("z", 2, 1), ("xz", 4, 2), ("xyz", 6, 3)])
def test_fewer_axes_are_fewer_integers(axes: str, force_levels: int, position_levels: int) -> None:
    assert force_channel(axes=axes).level_count == force_levels
    assert position_channel(axes=axes).level_count == position_levels


def test_two_builds_from_the_same_numbers_code_alike() -> None:
    levels = force_channel().levels((1.0, 2.0, 3.0), (0.01, 0.02, 0.03))
    assert force_channel().sample(4, levels) == force_channel().sample(4, levels)


@pytest.mark.parametrize("predictor", list(PARAMETRIC))
def test_a_hybrid_chooses_among_no_parameters(predictor: str) -> None:
    with pytest.raises(ValueError, match=f"{predictor}.*adaptive"):
        force_channel(predictor="hybrid", bank=["zoh", predictor])
    assert force_channel(predictor="adaptive", bank=["zoh", predictor]).bank == ("zoh", predictor)


def test_the_banks_by_default_are_those_of_the_name() -> None:
    assert force_channel(predictor="adaptive").bank == ADAPTIVE_BANK
    assert force_channel(predictor="hybrid").bank == force_channel().bank == HYBRID_BANK


@pytest.mark.parametrize(
    ("predictor", "estimates"),
    [("zoh", False), ("hybrid", False), ("trend", True), ("surface", True), ("adaptive", True)],
)
def test_the_sender_looks_at_all_samples_where_it_estimates(predictor: str, estimates: bool) -> None:
    assert force_channel(predictor=predictor).estimates == estimates
