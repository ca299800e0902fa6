"""The shipped recordings by source: what they are, where they come from and under which licence.

An archive is a ZIP file with LZMA members, which `numpy.load` reads. A recording of n samples has two members: `NAME`,
the changes from sample to sample of its 7 columns in units of the last decimal digit, as little-endian int64 with the
bytes of equal weight side by side, shape (7, 8, n); and `NAME.digits`, the decimals of each column, shape (7,). So it
has every decimal digit of the conversion, in a third of the bytes of compressed floating-point numbers.
"""

import zipfile
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from weberlink.master.trace import Trace, as_trace

DATA = Path(str(files("weberlink_studies.recordings") / "data"))


@dataclass(frozen=True)
class Source:
    """Where recordings come from."""

    name: str  # first part of the name of each of its recordings
    about: str  # what was recorded
    rate: str  # of the samples, as shipped
    repository: str  # on github.com
    licence: str  # SPDX identifier; its text is in `data/`
    no_surface: str | None = None  # first words of the recordings that touch no surface

    @property
    def archive(self) -> Path:
        return DATA / f"{self.name}.npz"

    def recordings(self) -> tuple[str, ...]:
        """Names of its recordings."""
        return _members(self)


SOURCES = {
    source.name: source
    for source in (
        Source(
            "tue",
            "a person teleoperates a robot of one degree of freedom that taps aluminium (rigid), foam, a spring or "
            "nothing (free); position and contact force at the robot. The scale of the force is uncertain by 1.5",
            "1 kHz, means of pairs at 2 kHz",
            "Ohara124c41/Haptics-Bilateral_Teleoperation-1DOF_Experiments",
            "MIT",
            no_surface="tue_free",
        ),
        Source(
            "omega3",
            "a person moves an omega.3 of three degrees of freedom in a guidance field; measured position, commanded "
            "force. A field has no surface",
            "1 kHz, interpolated from 500 Hz",
            "xhtsansiro/A_Dynamical-System-Approach-to-Shared-Control",
            "MIT",
            no_surface="omega3",
        ),
        Source(
            "ochoa_polish",
            "a person moves a Franka arm by hand over a mould; force from the joint torques, the net of hand and mould",
            "1 kHz",
            "ochoa92/TOOLING4G",
            "Apache-2.0",
        ),
        Source(
            "panda_comanip",
            "a person guides a Franka arm with a force sensor at its wrist along a printed symbol, so the force "
            "is that of the hand; its frame and sign are not documented",
            "1 kHz with lost samples, 695 Hz on average",
            "AutoLabModena/Panda-Co-Manipulation-Dataset",
            "MIT",
            no_surface="panda_comanip",
        ),
        Source(
            "stroke_iiwa_teleop",
            "a teleoperated KUKA arm with a force sensor passes over obstacles",
            "200 Hz",
            "StrokeAIRobotics/Diffusion-Based-Impedance-Learning_T-RO",
            "MIT",
        ),
    )
}
"""By name."""


def names(source: str | None = None) -> tuple[str, ...]:
    """Names of the recordings of one source, or of all."""
    chosen = SOURCES.values() if source is None else (SOURCES[source],)
    return tuple(name for each in chosen for name in each.recordings())


def source_of(name: str) -> Source:
    """The source of a recording."""
    for source in SOURCES.values():
        if name in source.recordings():
            return source
    raise KeyError(f"{name}: no shipped recording; those of {', '.join(SOURCES)} are")


def has_surface(name: str) -> bool:
    """Whether the robot or tool of a recording touches a surface, whose geometry predicts the force."""
    without = source_of(name).no_surface
    return without is None or not name.startswith(without)


def load(name: str) -> Trace:
    """A recording: position [m] and force [N] on the operator's side of the contact (the reaction), unfiltered."""
    with np.load(source_of(name).archive) as archive:
        split, digits = archive[name], archive[f"{name}.digits"]
    changes = np.ascontiguousarray(split.transpose(0, 2, 1)).view("<i8")[..., 0]
    scales = np.array([10.0 ** int(count) for count in digits])
    return as_trace(np.cumsum(changes, axis=1).T / scales)


@cache
def _members(source: Source) -> tuple[str, ...]:
    with zipfile.ZipFile(source.archive) as archive:
        members = [member.removesuffix(".npy") for member in archive.namelist()]
    return tuple(member for member in members if not member.endswith(".digits"))
