"""The options of a modelled hand, of its wrist, and of the device that it holds."""

from typing import Literal, NamedTuple, Self

from pydantic import Field, model_validator

from weberlink.geometry.vector import ZERO, Vector, check_home
from weberlink.options import Options


class Oscillator(NamedTuple):
    """A mass [kg] or an inertia [kg m^2], its damper and its spring, per metre or per radian."""

    inertia: float
    damping: float
    stiffness: float

    def gain(self, omega: float) -> float:
        """|x / intended| of the free handle at `omega` [rad/s]: k / |k - m omega^2 + j b omega|."""
        return abs(self.stiffness / self.dynamic_stiffness(omega))

    def dynamic_stiffness(self, omega: float) -> complex:
        """Force per displacement at `omega` [rad/s]."""
        return complex(self.stiffness - self.inertia * omega * omega, self.damping * omega)


class GraspOptions(Options):
    """Fingers that hold a handle: spring and damper between the mass of the arm and that of the handle.

    At the frequencies at which a stiff wall becomes unstable, an arm no longer follows the handle, and only grasp and
    handle count. The spring between fingers and handle rises with the grip force, from some hundred newtons per metre
    on, and its damper is a few N s/m: Hajian and Howe, "Identification of the mechanical impedance at the human finger
    tip", J. Biomech. Eng. 119 (1997), for one finger pressed on; Kuchenbecker, Park and Niemeyer, "Characterizing the
    human wrist for improved haptic interaction", ASME IMECE (2003), for a stylus held by fingers and wrist; Hasser and
    Cutkosky, "System identification of the human hand grasping a haptic knob", Haptic Symposium (2002), for the rise
    of both with the grip. The values of `GRASPS` are of this order, chosen and not fitted.
    """

    stiffness_n_m: float = Field(ge=1e-3, le=1e9, description="between arm and handle")
    damping_n_s_m: float = Field(ge=0.0, le=1e6, description="between arm and handle")
    handle_kg: float = Field(default=0.1, ge=1e-6, le=1e3, description="moving mass of the device at its tip")
    handle_damping_n_s_m: float = Field(default=0.1, ge=0.0, le=1e6, description="of the device itself")

    @property
    def oscillator(self) -> Oscillator:
        """Grasp and handle without the damping of the device."""
        return Oscillator(self.handle_kg, self.damping_n_s_m, self.stiffness_n_m)


GRASPS = {
    "pinch": GraspOptions(stiffness_n_m=1500.0, damping_n_s_m=2.3),
    "fingertip": GraspOptions(stiffness_n_m=650.0, damping_n_s_m=1.1),
}
"""Grasps by name. A wall felt a tick of 1 ms late is stable up to 2,240 and 1,120 N/m with them, and up to 5,370 N/m
with the hand that has none and holds firmly."""


class HandOptions(Options):
    """Impedance of hand and handle.

    The defaults are those of a firm, posture-keeping arm. The order of magnitude is that of van Beek, Bergmann Tiest,
    Mugge and Kappers, "Haptic perception of force magnitude and its relation to postural arm dynamics in 3D", Sci. Rep.
    5:18004 (2015), where one trial gave 0.55 kg, 6.5 N s/m and 135 N/m.
    """

    mass_kg: float = Field(
        default=0.3, ge=1e-6, le=1e3, description="hand and handle; the hand alone if it has a grasp"
    )
    damping_n_s_m: float = Field(default=8.0, ge=0.0, le=1e6)
    stiffness_n_m: float = Field(
        default=300.0, ge=1e-3, le=1e9, description="how hard it holds on to where it wants to be"
    )
    grasp: Literal["pinch", "fingertip"] | GraspOptions | None = Field(
        default=None, description="how fingers hold the handle; without it, hand and handle are one mass"
    )

    @property
    def damping_at_handle(self) -> float:
        """Damping that a wall at the handle meets at high frequency, where the arm no longer follows [N s/m]."""
        held = self.held
        return self.damping_n_s_m if held is None else held.damping_n_s_m + held.handle_damping_n_s_m

    @property
    def held(self) -> GraspOptions | None:
        """The grasp that is meant, also where it is named."""
        return GRASPS[self.grasp] if isinstance(self.grasp, str) else self.grasp

    @property
    def oscillator(self) -> Oscillator:
        """The mass that the intention acts on, without the grasp."""
        return Oscillator(self.mass_kg, self.damping_n_s_m, self.stiffness_n_m)

    def gain(self, omega: float) -> float:
        """|x / intended| of the free handle at `omega` [rad/s]."""
        held = self.held
        if held is None:
            return self.oscillator.gain(omega)
        grasp = complex(held.stiffness_n_m, held.damping_n_s_m * omega)
        handle = complex(-held.handle_kg * omega * omega, held.handle_damping_n_s_m * omega)
        arm = self.oscillator.dynamic_stiffness(omega) + grasp * handle / (grasp + handle)
        return abs(self.stiffness_n_m / arm * grasp / (grasp + handle))


class WristOptions(Options):
    """Rotational impedance of hand and handle about the tip, the same about every axis, with tremor and wobble.

    The defaults are an assumption, not a measurement: natural frequency (5 Hz) and damping ratio (0.42) are those of
    the hand that moves, and 2 N m/rad is meant for a hand that holds on. A real wrist is stiffer in some directions
    than in others, and relaxed it is softer (Formica, Charles, Zollo, Guglielmelli, Hogan and Krebs, "The passive
    stiffness of the wrist and forearm", J. Neurophysiol. 108, 2012).
    """

    inertia_kg_m2: float = Field(default=0.002, ge=1e-9, le=1e3, description="hand and handle")
    damping_n_m_s_rad: float = Field(default=0.053, ge=0.0, le=1e6)
    stiffness_n_m_rad: float = Field(
        default=2.0, ge=1e-6, le=1e9, description="how hard it holds on to how it wants to be"
    )
    tremor_rad: float = Field(
        default=0.0005, ge=0.0, le=0.1, description="RMS about each axis of the free hand, 8 to 12 Hz; 0 for none"
    )
    wobble_deg: Vector = Field(
        default=ZERO, description="amplitude of a slow turning about x, y, z on top of the script, as one who explores"
    )
    wobble_hz: float = Field(default=0.3, gt=0.0, le=5.0)

    @property
    def oscillator(self) -> Oscillator:
        return Oscillator(self.inertia_kg_m2, self.damping_n_m_s_rad, self.stiffness_n_m_rad)


class HandDeviceOptions(Options):
    """Options of the device and of the hand."""

    hand: HandOptions = HandOptions()
    wrist: WristOptions | None = Field(
        default=None, description="the hand turns the handle too, and feels torque; without it there is no orientation"
    )
    tremor_m: float = Field(
        default=30e-6, ge=0.0, le=0.01, description="RMS per axis of the free hand, 8 to 12 Hz; 0 for none"
    )
    seed: int = Field(default=1, ge=0, description="of the tremor")
    home_m: Vector = Field(default=(0.0, 0.0, 0.03), description="where the hand rests at first")
    workspace_m: float = Field(default=0.06, ge=1e-3, le=1.0, description="half an edge of the cube about the origin")
    force_n: float = Field(
        default=12.0, ge=0.01, le=1e4, description="largest force that the device displays; more is cut to it"
    )
    torque_n_m: float = Field(
        default=0.5,
        ge=1e-4,
        le=1e4,
        description="largest torque that it displays on a hand with a wrist; more is cut to it",
    )
    stiffness_n_m: float = Field(
        default=3000.0, ge=1e-3, le=1e9, description="stiffest wall that the device displays stably"
    )

    @model_validator(mode="after")
    def check_home(self) -> Self:
        check_home(self.home_m, self.workspace_m)
        return self
