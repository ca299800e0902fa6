"""The compiled codec beside the live one: every update, error and bound the same, bit for bit.

The loop is tested twice: as numba compiles it, and interpreted, which needs no numba.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace as with_changes
from importlib.util import find_spec
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.codec.signals import contact_stream
from tests.examples import examples
from tests.studies.evaluate.signals import walk, wall
from weberlink.codec import Channel, force_channel, position_channel
from weberlink.codec.deadband import Reference
from weberlink.codec.predictors import FITTED, Trust
from weberlink.codec.quantizer import INT16_MAX
from weberlink.codec.smoothing import Smoothing
from weberlink.codec.update import MAX_GAP
from weberlink.geometry.vector import Vector
from weberlink.master.trace import read_trace
from weberlink.studies.evaluate.compiled import loop
from weberlink.studies.evaluate.engine import WORTH_COMPILING, coding, fitting
from weberlink.studies.evaluate.replay import Replay, Signal, replay, signal_of
from weberlink.studies.evaluate.sweep import Recording, Study

HERE = Path(__file__).parents[3]
RECORDED = HERE.parent / "shared" / "traces"
RECORDINGS = [HERE / "configs" / "traces" / "operator.csv", *sorted(RECORDED.glob("*.csv"))]
REFERENCES: tuple[Reference, ...] = ("actual", "displayed", "sent")
BANKS = [("zoh",), ("linear",), ("plane",), ("sphere",), ("linear", "plane"), ("sphere", "zoh"), tuple(FITTED)]
CREDULOUS = Trust(radius=(1e-9, 1e9), stiffness=(1e-6, 1e12), least_angle_sine=1e-12, misfit=inf)

needs_numba = pytest.mark.skipif(find_spec("numba") is None, reason="numba (extra: compiled) is not installed")
needs_recordings = pytest.mark.skipif(
    not RECORDED.is_dir(), reason="recordings of people lie in ../shared/traces, which is not here"
)


def interpreted(signal: Signal, channel: Channel) -> tuple[loop.Ticks, loop.Sends]:
    """The loop on the codec's own objects, its arrays as long as those of the compiled run."""
    count = len(signal)
    ticks = loop.Ticks(np.empty(count), np.empty(count), np.empty(count))
    sends = loop.Sends(*(np.empty(count, np.int64) for _ in range(3)), *(np.empty((count, 3)) for _ in range(2)))
    bank = np.array([loop.CODES[name] for name in channel.bank])
    packets = loop.run(channel, bank, signal.force_n, signal.position_m, ticks, sends)
    return ticks, loop.Sends(*(column[:packets] for column in sends))


def compiled(signal: Signal, channel: Channel) -> Replay:
    return coding("compiled")(signal, channel)


def assert_alike(found: Replay, expected: Replay) -> None:
    assert list(found.updates) == list(expected.updates)
    assert found.error_n.tobytes() == expected.error_n.tobytes()
    assert found.bound_n.tobytes() == expected.bound_n.tobytes()
    assert found.deviation_n.tobytes() == expected.deviation_n.tobytes()
    assert found.selected.tolist() == expected.selected.tolist()
    assert found.paired == expected.paired


def check(signal: Signal, channel: Channel) -> int:
    """Both must agree; how many updates it took."""
    expected = replay(signal, channel)
    assert_alike(compiled(signal, channel), expected)
    return len(expected.updates)


def signal(samples: Sequence[tuple[Vector, Vector]]) -> Signal:
    return Signal(np.array([force for force, _ in samples]), np.array([place for _, place in samples]), 1e-3)


def pushed(forces: Sequence[float], depths: Sequence[float] | None = None) -> Signal:
    """Along z."""
    place = depths if depths is not None else [0.0] * len(forces)
    return signal([((0.0, 0.0, force), (0.0, 0.0, -depth)) for force, depth in zip(forces, place, strict=True)])


@needs_numba
@pytest.mark.parametrize("axes", ["xyz", "xz", "z"])
@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("bank", BANKS, ids=",".join)
def test_contacts_of_all_kinds(bank: tuple[str, ...], reference: Reference, axes: str) -> None:
    channel = force_channel(bank=bank, reference=reference, axes=axes)
    sent = [check(signal(contact_stream(seed, ticks=300, axes=axes)), channel) for seed in range(4)]
    assert sum(sent) > 10


@needs_numba
@given(
    bank=st.permutations(list(FITTED)).flatmap(lambda names: st.integers(1, 4).map(lambda count: names[:count])),
    reference=st.sampled_from(REFERENCES),
    weber=st.sampled_from([0.0, 0.025, 0.1, 0.3]),
    floor=st.sampled_from([0.0, 0.02, 0.5]),
    wire=st.sampled_from([(1e-3, 1e-5, True), (1e-3, 2e-6, True), (1e-9, 1e-12, False), (0.3, 1e-3, False)]),
    trust=st.sampled_from([Trust(), CREDULOUS]),
    samples=st.lists(
        st.tuples(*[st.tuples(*[st.floats(-60.0, 60.0) | st.sampled_from([0.0, -0.0, 0.5e-3, 1.5e-3])] * 3)] * 2),
        min_size=1,
        max_size=40,
    ),
)
@examples(150)
def test_any_finite_samples(
    bank: list[str], reference: Reference, weber: float, floor: float, wire: tuple[float, float, bool], trust: Trust,
    samples: list[tuple[Vector, Vector]],
) -> None:  # fmt: skip
    force_step, position_step, saturates = wire
    check(
        signal(samples),
        force_channel(
            bank=bank, reference=reference, weber=weber, floor=floor, trust=trust,
            force_step=force_step, position_step=position_step, saturates=saturates,
        ),
    )  # fmt: skip


@needs_numba
@given(
    bank=st.sampled_from(BANKS),
    saturates=st.booleans(),
    samples=st.lists(
        st.tuples(*[st.tuples(*[st.sampled_from([1.0, -2.0, 0.0]) | st.floats()] * 3)] * 2), min_size=1, max_size=20
    ),
)
@examples(150)
def test_any_numbers_and_what_is_none(
    bank: tuple[str, ...], saturates: bool, samples: list[tuple[Vector, Vector]]
) -> None:
    """NaN, infinity, denormals, the largest numbers there are; also where nothing saturates and levels pass 2^63."""
    check(signal(samples), force_channel(bank=bank, floor=0.0, saturates=saturates))


RAMP = [2e-3 + 5e-5 * tick for tick in range(200)]
EDGES: dict[str, Signal] = {
    "nothing": pushed([0.0] * 50),
    "less than nothing": pushed([-0.0] * 50),
    "constant": pushed([1.0] * 50),
    "the least number there is": pushed([5e-324] * 20 + [1e-310] * 20),
    "from 2 N to a denormal": pushed([2.0, *[1e-310] * 20]),
    "the largest numbers": pushed([1e300, -1e300] * 20 + [1.7e308] * 5),
    "a stiff wall": pushed([2e4 * depth for depth in RAMP], RAMP),
    "a wall through the end of the range": pushed([5e3 * depth for depth in RAMP], RAMP),
    "a wall with holes": pushed([500.0 * depth if index % 7 else nan for index, depth in enumerate(RAMP)], RAMP),
    "never a number": pushed([nan] * 20),
    "infinite after 1 N": pushed([1.0, *[inf, -inf] * 10]),
    "at no place": pushed([1.0] * 10, [0.0, nan] * 5),
    "halfway between two levels": pushed([0.0005, 0.0015, 0.0025, 0.0035, -0.0005, -0.0015] * 5),
    "in a corner of the range": signal([((1e-3 * INT16_MAX + 1e-4,) * 3, (0.4, -0.4, 0.4))] * 30),  # type: ignore[list-item]
}


@needs_numba
@pytest.mark.parametrize("saturates", [True, False])
@pytest.mark.parametrize("floor", [0.0, 0.02])
@pytest.mark.parametrize("name", EDGES)
def test_edges(name: str, floor: float, saturates: bool) -> None:
    for bank in BANKS:
        check(EDGES[name], force_channel(bank=bank, floor=floor, saturates=saturates))


@needs_numba
@pytest.mark.parametrize("gap", [MAX_GAP, MAX_GAP + 1])
def test_samples_too_far_apart_to_pair(gap: int) -> None:
    made, channel = pushed([1.0] * gap + [3.0]), force_channel(predictor="linear")
    found = compiled(made, channel)
    assert_alike(found, replay(made, channel))
    assert [update.gap for update in found.updates] == [0, gap if gap <= MAX_GAP else 0]


@needs_numba
@needs_recordings
@pytest.mark.parametrize("path", RECORDINGS, ids=lambda path: path.stem)
def test_recordings(path: Path) -> None:
    recording = signal_of(read_trace(path))
    for bank in (*BANKS[:4], BANKS[-1]):
        assert check(recording, force_channel(bank=bank)) > 10
    assert check(recording, force_channel(weber=0.05, force_step=1e-9, position_step=1e-12, saturates=False)) > 10


@needs_numba
def test_rows_do_not_tell_what_coded() -> None:
    for made in (wall(), walk(500, seed=3)):
        study = Study(webers=(0.05, 0.20))
        rows = [
            [with_changes(row, tick_us=0.0) for row in with_changes(study, engine=engine).rows(Recording("made", made))]
            for engine in ("python", "compiled")
        ]
        assert rows[0] == rows[1]


@needs_numba
def test_the_run_time_of_a_tick_is_that_of_the_live_codec() -> None:
    found = compiled(signal_of(wall(3000)), force_channel())
    assert found.tick_us > 0.0
    assert len(found.error_n) == 3000


@needs_numba
@pytest.mark.parametrize("channel", [position_channel(), position_channel(predictor="hybrid")])
def test_refuses_a_channel_that_is_not_one_of_forces(channel: Channel) -> None:
    from weberlink.studies.evaluate.compiled.replay import run  # noqa: PLC0415

    with pytest.raises(ValueError, match="forces"):
        run(signal_of(wall(10)), channel)


@needs_numba
@pytest.mark.parametrize(
    "channel",
    [force_channel(predictor="adaptive"), force_channel(predictor="trend"), force_channel(smoothing=Smoothing(5))],
)
def test_what_cannot_be_compiled_is_coded_by_the_live_codec(channel: Channel) -> None:
    signal = signal_of(wall(500))
    found, expected = compiled(signal, channel), replay(signal, channel)
    assert list(found.updates) == list(expected.updates)
    assert np.array_equal(found.error_n, expected.error_n)


@needs_numba
def test_updates_of_a_run_are_a_sequence() -> None:
    found = compiled(signal_of(wall()), force_channel(predictor="linear")).updates
    assert found[-1] == list(found)[-1]
    assert found[1:3] == list(found)[1:3]
    with pytest.raises(IndexError):
        found[len(found)]


@pytest.mark.parametrize("bank", BANKS, ids=",".join)
@pytest.mark.parametrize("make", [lambda: wall(400), lambda: walk(300, seed=2)], ids=["wall", "walk"])
def test_the_loop_interpreted_is_the_live_codec(make: Callable[[], object], bank: tuple[str, ...]) -> None:
    made = signal_of(make())  # type: ignore[arg-type]
    channel = force_channel(bank=bank)
    ticks, sends = interpreted(made, channel)
    expected = replay(made, channel)
    assert ticks.error_n.tobytes() == expected.error_n.tobytes()
    assert ticks.bound_n.tobytes() == expected.bound_n.tobytes()
    assert sends.tick.tolist() == [update.tick for update in expected.updates]
    assert sends.selector.tolist() == expected.selected.tolist()
    assert sends.gap.tolist() == [update.gap for update in expected.updates]
    levels = np.hstack((sends.value_levels, sends.position_levels))
    assert levels.tolist() == [list(update.newest) for update in expected.updates]


def test_the_loop_knows_every_predictor() -> None:
    assert set(loop.CODES) == set(FITTED)


def test_little_work_is_not_compiled() -> None:
    assert fitting(WORTH_COMPILING - 1.0) == "python"
    assert fitting(WORTH_COMPILING) == ("compiled" if find_spec("numba") else "python")
