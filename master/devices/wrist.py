"""What a file says of how the operator's hand turns the handle. Computes nothing."""

from pydantic import BaseModel, ConfigDict, Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.hand import Oscillator


class WristOptions(BaseModel):
    """Rotational impedance of hand and handle about the tip, alike about every axis; and what turns it unasked.

    The defaults are an assumption, not a measurement: natural frequency (5 Hz) and damping ratio (0.42) are those of
    the hand that moves, and 2 N m/rad is meant for a hand that holds on. A real wrist is stiffer in some directions
    than in others, and relaxed it is softer (Formica, Charles, Zollo, Guglielmelli, Hogan and Krebs, "The passive
    stiffness of the wrist and forearm", J. Neurophysiol. 108, 2012).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    inertia_kg_m2: float = Field(default=0.002, gt=0.0, description="hand and handle")
    damping_n_m_s_rad: float = Field(default=0.053, ge=0.0)
    stiffness_n_m_rad: float = Field(default=2.0, gt=0.0, description="how hard it holds on to how it wants to be")
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
