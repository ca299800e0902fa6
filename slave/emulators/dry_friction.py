"""One implicit step of four coupled joints with dry friction, solved exactly. Pure algebra."""

from collections.abc import Sequence

from weberlink.slave.emulators.pose import Joints, Symmetric

FLIPS = 3**4  # no pattern of four joints comes back; two or three are what happens, 27 the most of 300 000 at random


def with_dry_friction(a: Symmetric, r: Sequence[float], most: Sequence[float], before: Joints) -> Joints:
    """The v with a v + s = r, where s_i = most_i sign(v_i), or anything up to that where v_i = 0.

    It is where 1/2 v^T a v - r^T v + sum most_i |v_i| is least: there is one, since a is positive definite. Which
    joints stick is guessed from what they did before, and flipped joint by joint, always the first that contradicts
    (Murty's rule, which ends); a joint that stands still does so exactly, so nothing creeps or chatters.

    Args:
        a: Inertia of the step [kg m^2].
        r: Momentum that the step would reach without friction [N m s].
        most: Largest impulse of friction [N m s].
        before: Velocities that the step begins with [rad/s].
    """
    signs = [0.0 if v == 0.0 and m > 0.0 else 1.0 if v > 0.0 else -1.0 for v, m in zip(before, most, strict=True)]
    v = sliding(a, r, most, signs)
    for _ in range(FLIPS):
        flipped = _contradiction(a, r, most, signs, v)
        if flipped is None:
            break
        joint, sign = flipped
        signs[joint] = sign
        v = sliding(a, r, most, signs)
    return v


def _contradiction(
    a: Symmetric, r: Sequence[float], most: Sequence[float], signs: Sequence[float], v: Joints
) -> tuple[int, float] | None:
    """The first joint that slides against its friction, or sticks though it is pushed harder than friction holds."""
    for i, (sign, holds) in enumerate(zip(signs, most, strict=True)):
        if sign != 0.0:
            if v[i] * sign < 0.0 and holds > 0.0:
                return i, 0.0
        elif holds > 0.0:
            push = r[i] - _row(a, i, v)
            if abs(push) > holds:
                return i, 1.0 if push > 0.0 else -1.0
    return None


def _row(a: Symmetric, i: int, v: Joints) -> float:
    if i == 0:
        return a[0] * v[0] + a[1] * v[1] + a[3] * v[2] + a[6] * v[3]
    if i == 1:
        return a[1] * v[0] + a[2] * v[1] + a[4] * v[2] + a[7] * v[3]
    if i == 2:
        return a[3] * v[0] + a[4] * v[1] + a[5] * v[2] + a[8] * v[3]
    return a[6] * v[0] + a[7] * v[1] + a[8] * v[2] + a[9] * v[3]


def times(a: Symmetric, v: Joints) -> list[float]:
    """a v"""
    v0, v1, v2, v3 = v
    return [
        a[0] * v0 + a[1] * v1 + a[3] * v2 + a[6] * v3,
        a[1] * v0 + a[2] * v1 + a[4] * v2 + a[7] * v3,
        a[3] * v0 + a[4] * v1 + a[5] * v2 + a[8] * v3,
        a[6] * v0 + a[7] * v1 + a[8] * v2 + a[9] * v3,
    ]


def sliding(a: Symmetric, r: Sequence[float], most: Sequence[float], signs: Sequence[float]) -> Joints:
    """The velocities where joints slide with the signs given, or stand still where that is 0: L D L^T, written out."""
    a00, a10, a11, a20, a21, a22, a30, a31, a32, a33 = a
    s0, s1, s2, s3 = signs
    r0, r1, r2, r3 = r[0] - s0 * most[0], r[1] - s1 * most[1], r[2] - s2 * most[2], r[3] - s3 * most[3]
    if most[0] > 0.0 and s0 == 0.0:
        a00, a10, a20, a30, r0 = 1.0, 0.0, 0.0, 0.0, 0.0
    if most[1] > 0.0 and s1 == 0.0:
        a10, a11, a21, a31, r1 = 0.0, 1.0, 0.0, 0.0, 0.0
    if most[2] > 0.0 and s2 == 0.0:
        a20, a21, a22, a32, r2 = 0.0, 0.0, 1.0, 0.0, 0.0
    if most[3] > 0.0 and s3 == 0.0:
        a30, a31, a32, a33, r3 = 0.0, 0.0, 0.0, 1.0, 0.0
    l10, l20, l30 = a10 / a00, a20 / a00, a30 / a00
    d1, e21, e31 = a11 - l10 * a10, a21 - l20 * a10, a31 - l30 * a10
    l21, l31 = e21 / d1, e31 / d1
    d2, e32 = a22 - l20 * a20 - l21 * e21, a32 - l30 * a20 - l31 * e21
    l32 = e32 / d2
    d3 = a33 - l30 * a30 - l31 * e31 - l32 * e32
    r1 -= l10 * r0
    r2 -= l20 * r0 + l21 * r1
    r3 -= l30 * r0 + l31 * r1 + l32 * r2
    v3 = r3 / d3
    v2 = r2 / d2 - l32 * v3
    v1 = r1 / d1 - l21 * v2 - l31 * v3
    return (r0 / a00 - l10 * v1 - l20 * v2 - l30 * v3, v1, v2, v3)
