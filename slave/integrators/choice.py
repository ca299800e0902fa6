"""Choice of the integrator for a robot and its scene, and of the number of steps per tick."""

from math import ceil, sqrt
from typing import NamedTuple

from weberlink.slave.integrators.contract import ControlledMass
from weberlink.slave.scenes.scene import Scene

AUTO = "auto"
STEP_ANGLE = 0.2  # largest omega h and largest c h / m of a semi-implicit substep, for accuracy
FEW = 12  # substeps that cost no more than one implicit step, with a smaller error (`weberlink precision`)
SUBSTEPS_MOST = 64


class IntegratorChoice(NamedTuple):
    """A name in the table of integrators, steps per tick, and the reason in a few words."""

    integrator: str
    substeps: int
    reason: str


def chosen(
    body: ControlledMass, scene: Scene | None, period: float, integrator: str = AUTO, substeps: int | None = None
) -> IntegratorChoice:
    """The integrator of this name; for `auto` one that is stable for all constants.

        exact          flat contact without friction, or none: no error, at the cost of four semi-implicit substeps
        semi_implicit  where at most twelve substeps resolve the stiffest contact and the strongest damper
        implicit       else, one step: it resolves less, and is always stable

    Measured on a scene with friction (2-core VM, Python 3.11): a semi-implicit substep costs 5 to 10 us, an implicit
    step 50 to 90 us. On flat contact an exact step costs 15 us, a semi-implicit one 4 us. On a curved surface the exact
    scheme follows tangents, and in a few percent of extreme random trials it gained energy, so it is not chosen there.
    A semi-implicit substep resolves omega h <= 0.2 and c h / m <= 0.2, hence

        substeps = ceil(T max(sqrt((k + k_scene) / m), (c + c_scene) / m) / 0.2)

    Args:
        period: T, between two ticks [s].
        integrator: A name in the table of integrators, or `auto`.
        substeps: Steps per tick; computed if not given.

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
        if scene.flat and not scene.rubs:
            return IntegratorChoice("exact", substeps or 1, f"flat contact, {told}")
        if resolving <= (substeps or FEW):
            return IntegratorChoice("semi_implicit", substeps or resolving, told)
        what = "friction" if scene.rubs else "curved contact"
        return IntegratorChoice("implicit", substeps or 1, f"{what}, {told}")
    if integrator != "semi_implicit":
        return IntegratorChoice(integrator, substeps or 1, f"as named, {told}")
    count = substeps or min(resolving, SUBSTEPS_MOST)
    step = period / count
    if 2.0 * damping * step / body.mass + stiffness * step * step / body.mass >= 4.0:
        raise ValueError(
            f"integrator: semi_implicit is unstable in {count} substeps of a {period:g} s tick for {body.mass:g} kg "
            f"against {stiffness:g} N/m and {damping:g} N s/m; expected {remedy(resolving, count)}"
        )
    return IntegratorChoice(integrator, count, f"as named, {told}")


def remedy(resolving: int, count: int) -> str:
    more = f"substeps: {resolving}, or " if count < resolving <= SUBSTEPS_MOST else ""
    return f"{more}integrator: auto (which cannot be unstable), implicit or exact"
