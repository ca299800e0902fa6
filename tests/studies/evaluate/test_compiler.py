"""What numba is told of the codec, and what is kept of what it made."""

import pkgutil
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any

import pytest

import weberlink.codec

pytest.importorskip("numba", reason="numba (extra: compiled) is not installed")

from weberlink.codec import force_channel
from weberlink.codec.deadband import LevelCrossingDeadband
from weberlink.codec.predictors import Trust
from weberlink.codec.quantizer import Quantizer
from weberlink.studies.evaluate.compiled import compiler

LIVE_ONLY = {
    "weberlink.codec.deadband.shapes", "weberlink.codec.decoder", "weberlink.codec.encoder", "weberlink.codec.fitted",
    "weberlink.codec.parameters",
    "weberlink.codec.predictors.affine", "weberlink.codec.predictors.surface", "weberlink.codec.predictors.trend",
    "weberlink.codec.smoothing",
}  # fmt: skip
"""Nothing of these is compiled, nor of what an adaptive sender estimates."""
PACKAGES = {"weberlink.codec.adaptive", "weberlink.codec.deadband", "weberlink.codec.predictors"}


def modules() -> dict[str, ModuleType]:
    names = {found.name for found in pkgutil.walk_packages(weberlink.codec.__path__, "weberlink.codec.")}
    compiled = {name for name in names - LIVE_ONLY - PACKAGES if not name.startswith("weberlink.codec.adaptive.")}
    return {name: import_module(name) for name in compiled}


def test_what_is_kept_is_known_by_all_the_source_of_the_codec() -> None:
    """Or another codec would leave yesterday's machine code in use."""
    assert set(modules().values()) == set(compiler.SOURCES) - {compiler.loop}


def test_fields_are_those_of_the_object() -> None:
    channel = force_channel(weber=0.2, floor=0.1, reference="sent", axes="xz", trust=Trust((2.0, 3.0), (4.0, 5.0), 0.5))
    found = compiler.fields_of(channel)
    pairs: list[tuple[Any, object]] = [
        (found.trust, channel.trust),
        (found.deadband, channel.deadband),
        (found.value_quantizer, channel.value_quantizer),
        (found.position_quantizer, channel.position_quantizer),
    ]
    for fields, original in pairs:
        assert fields._asdict() == {name: getattr(original, name) for name in fields._fields}
    assert set(compiler.TrustFields._fields) == set(Trust.__dataclass_fields__)
    # What is read when it is made, and no more.
    unread = {"reference", "direction", "slope", "most", "period"}
    for kind, fields in compiler.DEADBANDS.items():
        told = set(kind.__dataclass_fields__) - unread
        assert set(fields._fields) == told - ({"weber"} if kind is LevelCrossingDeadband else set())
    assert set(compiler.QuantizerFields._fields) < set(Quantizer.__slots__)


def test_where_nothing_can_be_kept_it_is_compiled_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[bool] = []

    def njit(*, cache: bool, error_model: str) -> Callable[[Any], Any]:
        asked.append(cache)
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: function

    monkeypatch.setattr(compiler.numba, "njit", njit)
    compiler.compiled.__wrapped__()
    assert asked == [True, False]
