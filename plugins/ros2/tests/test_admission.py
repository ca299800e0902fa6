"""Which poses lead, in virtual time: one publisher at a time, in the right frame, finite, of rising time, not late."""

from collections.abc import Iterable
from itertools import accumulate, pairwise
from math import cos, inf, nan, pi, sin
from typing import Any

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from weberlink.geometry.rotation import LONGEST
from weberlink.geometry.vector import ZERO
from weberlink_ros2.admission import Admission, Pose, Subscription

WANTED = Subscription("/target", 0, None, "base", (0.4, 0.0, 0.3), 0.1, turns=True)
HERE = (0.41, -0.02, 0.33)
LEVEL = (1.0, 0.0, 0.0, 0.0)
AWAY_S = 12345.0  # by how much the publisher's clock is ahead


def pose(at: float, *, delay: float = 0.002, stamp_s: float | None = None, **other: Any) -> Pose:
    """A pose that arrives at a time [s]; its header has the time of publication unless another is given."""
    sent = at - delay + AWAY_S
    stamp = sent if stamp_s is None else stamp_s
    counted = round(at * 1e4)
    return Pose(round(stamp * 1e9), "base", HERE, LEVEL, b"a", round(sent * 1e9), counted)._replace(**other)


def let(subscription: Subscription = WANTED) -> Admission:
    admission = Admission(subscription)
    admission.engage()
    return admission


def taken(admission: Admission, poses: Iterable[tuple[float, Pose]]) -> list[bool]:
    return [admission.take(each, at) is not None for at, each in poses]


def every(period: float, count: int, **other: Any) -> list[tuple[float, Pose]]:
    return [(at, pose(at, **other)) for at in (1.0 + i * period for i in range(count))]


def test_target_is_relative_to_the_origin_and_an_orientation_becomes_a_rotation_vector() -> None:
    half = pi / 8
    turned = pose(1.0, orientation=(1.004 * cos(half), 0.0, 0.0, 1.004 * sin(half)))
    target = let().take(turned, 1.0)
    assert target == (pytest.approx((0.01, -0.02, 0.03)), pytest.approx((0.0, 0.0, pi / 4)))
    level = let(WANTED._replace(turns=False, frame_id=None))
    target = level.take(turned._replace(orientation=(nan, 0.0, 0.0, 0.0), frame_id="camera"), 1.0)
    assert target == (pytest.approx((0.01, -0.02, 0.03)), ZERO), "nothing turns, and any frame leads"


BAD = {
    "frame_id is 'map', not 'base'": {"frame_id": "map"},
    "position is not finite": {"position": (0.0, nan, 0.0)},
    "not finite: inf": {"position": (inf, 0.0, 0.0)},
    "orientation is no unit quaternion: 0, 0, 0, 0": {"orientation": (0.0, 0.0, 0.0, 0.0)},
    "orientation is no unit quaternion: 1.02": {"orientation": (1.02, 0.0, 0.0, 0.0)},
    "orientation is no unit quaternion: nan": {"orientation": (nan, 0.0, 0.0, 0.0)},
}


@pytest.mark.parametrize("why", BAD)
def test_bad_pose_counts_as_silence_and_is_told(why: str) -> None:
    admission = let()
    assert not any(taken(admission, every(0.01, 5, **BAD[why])))
    assert admission.is_silent(1.05)
    refusal = admission.refusal(1.05) or ""
    assert why in refusal and "\n" not in refusal
    assert all(taken(admission, [(at + 0.1, each) for at, each in every(0.01, 5)])), "good ones lead at once"
    assert admission.refusal(1.05 + 1.1) is None, "told for a second"


@pytest.mark.parametrize(("back_s", "why"), [(0.0, "time stands still"), (2.0, "time goes back by 2.000 s")])
def test_time_that_does_not_rise_lets_go(back_s: float, why: str) -> None:
    admission = let()
    poses = [(at, pose(at, stamp_s=50.0 - back_s * (at > 1.0))) for at in (1.0 + i * 0.011 for i in range(11))]
    assert taken(admission, poses[:10]) == [True, *[False] * 9]
    assert why in (admission.refusal(1.1) or "")
    assert taken(admission, poses[10:]) == [False]
    admission.engage()
    assert taken(admission, [(1.2, pose(1.2, stamp_s=48.0))]) == [True], "a recording that begins again"


def test_nobody_leads_before_a_person_lets_it_nor_after() -> None:
    admission = Admission(WANTED)
    assert not any(taken(admission, every(0.01, 5))) and admission.is_silent(1.05)
    assert admission.refusal(1.05) == "nobody lets it lead the hand; run: weberlink lead"
    admission.engage()
    assert all(taken(admission, [(at + 0.05, pose(at + 0.05)) for at, _ in every(0.01, 5)]))
    admission.release()
    assert taken(admission, [(1.1, pose(1.1))]) == [False] and admission.is_silent(1.1)


def test_after_the_leader_has_ended_nobody_leads_whatever_name_it_uses_until_the_next_act() -> None:
    for thief in (b"a", b"thief"):
        admission = let()
        assert all(taken(admission, every(0.01, 10)))
        later = [(1.2 + i * 0.01, pose(1.2 + i * 0.01, source=thief)) for i in range(20)]
        assert not any(taken(admission, later)) and admission.is_silent(1.4)
        told = admission.refusal(1.4) or ""
        assert "nothing came of the node that led for 110 ms: " in told and "run it again" in told
        admission.engage()
        assert all(taken(admission, [(1.4 + i * 0.01, pose(1.4 + i * 0.01, source=thief)) for i in range(5)]))


@pytest.mark.parametrize("ahead", [-3, 0, 1, 1000])
def test_who_copies_the_identity_of_the_leader_leads_at_most_until_its_next_pose(ahead: int) -> None:
    admission = let()
    assert all(taken(admission, every(0.01, 10, number=0)[:1]))
    for number in range(1, 10):
        assert taken(admission, [(1.0 + 0.01 * number, pose(1.0 + 0.01 * number, number=number))]) == [True]
    copied = taken(admission, [(1.095, pose(1.095, number=9 + ahead, position=(0.5, 0.0, 0.3)))])
    assert copied == [ahead > 0]
    assert not any(taken(admission, [(1.1 + 0.01 * i, pose(1.1 + 0.01 * i, number=10 + i)) for i in range(20)]))
    assert "two nodes publish under one identity" in (admission.refusal(1.3) or "")


def test_of_two_that_publish_none_begins_and_a_leader_is_not_disturbed_by_the_second() -> None:
    both = [(1.0 + i * 0.01, "ab"[i % 2].encode()) for i in range(20)]
    admission = Admission(WANTED)
    poses = [(at, pose(at, source=who)) for at, who in both]
    taken(admission, poses[:10])
    admission.engage()
    assert not any(taken(admission, poses[10:])), "both were there before the act"
    assert "two nodes publish it: end one" in (admission.refusal(1.2) or "")
    admission = let()
    assert taken(admission, poses) == [True, False] * 10
    assert "another node publishes it too" in (admission.refusal(1.2) or "")


@pytest.mark.parametrize("clock_s", [-3600.0, 0.0, 3600.0])
def test_poses_held_back_in_a_queue_are_late_and_lead_again_only_by_an_act(clock_s: float) -> None:
    """Two seconds of a publisher at 100 Hz come at once, then those of now; its clock may be wrong."""
    admission = let()
    sent = [1.0 + i * 0.01 for i in range(400)]
    arrived = [3.0 + i * 1e-4 if 1.0 < at < 3.0 else at + 0.002 for i, at in enumerate(sent)]
    poses = [
        (at, pose(at, delay=at - begun - clock_s, number=i))
        for i, (begun, at) in enumerate(zip(sent, arrived, strict=True))
    ]
    assert taken(admission, poses) == [True, *[False] * 399]
    admission = let()
    seen = []
    for at, each in poses:
        if at > 1.1 and admission.is_silent(at):
            admission.engage()
        seen.append(admission.take(each, at) is not None)
    fresh = [at - begun <= 0.11 for begun, at in zip(sent, arrived, strict=True)]
    assert seen == fresh and seen.count(False) > 150


def test_clock_set_back_by_a_second_is_forgiven() -> None:
    admission = let()
    assert all(taken(admission, every(0.01, 100, stamp_s=0.0)))
    admission.engage()
    later = [(2.0 + i * 0.01, pose(2.0 + i * 0.01, delay=1.0, stamp_s=0.0)) for i in range(1500)]
    seen = taken(admission, later)
    assert not seen[0]
    assert seen.index(True) == pytest.approx(900, abs=20), "at 0.1 s a second"
    assert all(seen[seen.index(True) :])


def test_slow_publisher_is_told_to_be_faster() -> None:
    admission = let()
    assert taken(admission, every(0.12, 10)) == [True, *[False] * 9]
    assert "for 120 ms: publish faster, or raise silence_ms" in (admission.refusal(2.1) or "")


FLOATS = st.floats() | st.floats(-1.0, 1.0)
POSES = st.builds(
    Pose,
    st.integers(-(2**63), 2**63),
    st.sampled_from(["base", "map", ""]),
    st.tuples(FLOATS, FLOATS, FLOATS),
    st.tuples(FLOATS, FLOATS, FLOATS, FLOATS) | st.just(LEVEL),
    st.sampled_from([b"a", b"b"]),
    st.integers(-(2**63), 2**63),
    st.integers(0, 30),
)


@examples(40)
@given(st.lists(st.tuples(st.floats(0.0, 0.3), POSES, st.booleans()), max_size=30))
def test_whatever_comes_targets_are_finite_and_of_one_leader_for_each_act(
    steps: list[tuple[float, Pose, bool]],
) -> None:
    admission = Admission(WANTED)
    times = list(accumulate(step for step, _, _ in steps))
    led: list[tuple[float, bytes]] = []
    for now, (_, each, acts) in zip(times, steps, strict=True):
        if acts:
            admission.engage()
            led = []
        if (target := admission.take(each, now)) is not None:
            led.append((now, each.source))
            assert max(map(abs, target[1])) <= LONGEST
            assert all(-inf < value < inf for value in (*target[0], *target[1]))
            assert not admission.is_silent(now)
            assert all(who == each.source for _, who in led)
            assert all(after - before <= WANTED.silence for (before, _), (after, _) in pairwise(led))
