"""Choice of the integrator for a robot and its scene, and of the number of steps per tick."""

from math import ceil, sqrt
from typing import NamedTuple

from weberlink.slave.integrators.contract import ControlledMass
from weberlink.slave.scenes.scene import Scene

AUTO = "auto"
STEP_ANGLE = 0.2  # largest omega h and largest c h / m of a semi-implicit substep, for accuracy
SUBSTEPS_MOST = 64
BUDGET = 0.15
"""Share of a tick that integration may take: the slave needs the rest for its network, codec and control, and for the
jitter of its host."""
SPLITTING_S = 60e-6
"""Stated time of a step of the exact scheme on tangent planes; `study precision` measures 54 to 64 us (2-core VM).
A run in virtual time must not depend on the machine and keeps this constant; a live daemon measures its own."""


class IntegratorChoice(NamedTuple):
    """A name in the table of integrators, steps per tick, and the reason in a few words."""

    integrator: str
    substeps: int
    reason: str


def chosen(
    body: ControlledMass,
    scene: Scene | None,
    period: float,
    integrator: str = AUTO,
    substeps: int | None = None,
    splitting_s: float = SPLITTING_S,
) -> IntegratorChoice:
    """The integrator of this name; for `auto` the one with the best error within the budget that gains no energy.

    That is `exact`. Where contact has a closed form one step is the solution. Elsewhere its error falls as the square
    of the step, so the budget, a share of the tick, is filled with substeps, at most as many as semi-implicit ones
    would resolve the motion. The implicit scheme costs more and resolves less, and the semi-implicit one, though
    cheaper, gains energy within each swing: they are for comparison, and the implicit one for the steps that `exact`
    cannot take.

    A semi-implicit substep resolves omega h <= 0.2 and c h / m <= 0.2, hence

        substeps = ceil(T max(sqrt((k + k_scene) / m), (c + c_scene) / m) / 0.2)

    Args:
        period: T, between two ticks [s].
        integrator: A name in the table of integrators, or `auto`.
        substeps: Steps per tick; computed if not given.
        splitting_s: Time of a step of the exact scheme where contact has no closed form.

    Raises:
        ValueError: The semi-implicit scheme was named and would be unstable, or an object of the scene moves.
    """
    if scene is not None and scene.moves:
        raise ValueError(
            "scene: a robot with a mass cannot touch an object with motion (no integrator knows the velocity of its "
            "surface); expected robot: {driver: point}, or objects without motion"
        )
    stiffness = body.stiffness + (0.0 if scene is None else scene.stiffness_n_m)
    damping = body.damping + (0.0 if scene is None else scene.damping_n_s_m)
    angle = period * max(sqrt(stiffness / body.mass), damping / body.mass)
    resolving = max(1, ceil(angle / STEP_ANGLE))
    told = f"{stiffness:.3g} N/m is {period * sqrt(stiffness / body.mass):.2g} rad per tick"
    if integrator == AUTO:
        if scene is None:
            return IntegratorChoice("exact", substeps or 1, "no contact")
        if scene.closed_form:
            what = "friction on a flat face" if scene.rubs else "flat contact"
            return IntegratorChoice("exact", substeps or 1, f"{what}, {told}")
        fitting = int(BUDGET * period / splitting_s)
        what = "curved contact" if not scene.flat else "friction with damping or on several faces"
        over = "" if fitting else f", {1e6 * splitting_s:.0f} us a step is over the budget"
        count = substeps or max(1, min(resolving, fitting, SUBSTEPS_MOST))
        return IntegratorChoice("exact", count, f"{what}, {told}{over}")
    if integrator != "semi_implicit":
        return IntegratorChoice(integrator, substeps or 1, f"as named, {told}")
    count = substeps or min(resolving, SUBSTEPS_MOST)
    step = period / count
    if 2.0 * damping * step / body.mass + stiffness * step * step / body.mass >= 4.0:
        more = f"substeps: {resolving}, or " if count < resolving <= SUBSTEPS_MOST else ""
        raise ValueError(
            f"integrator: semi_implicit is unstable in {count} substeps of a {period:g} s tick for {body.mass:g} kg "
            f"against {stiffness:g} N/m and {damping:g} N s/m; expected {more}integrator: auto (which cannot be "
            "unstable), implicit or exact"
        )
    return IntegratorChoice(integrator, count, f"as named, {told}")
