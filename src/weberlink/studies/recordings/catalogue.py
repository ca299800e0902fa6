"""The shipped recordings by source: what they are, where they come from and under which licence."""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

from weberlink.master.trace import Trace, as_trace
from weberlink.studies.recordings import archive

DATA = Path(str(files("weberlink.studies.recordings") / "data"))


@dataclass(frozen=True)
class Source:
    """Where recordings come from.

    Args:
        name: first part of the name of each of its recordings.
        about: what was recorded.
        rate: of the samples, as shipped.
        repository: on github.com.
        licence: SPDX identifier; its text is in `data/`.
    """

    name: str
    about: str
    rate: str
    repository: str
    licence: str

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
        ),
        Source(
            "omega3",
            "a person moves an omega.3 of three degrees of freedom in a guidance field; measured position, commanded "
            "force. A field has no surface",
            "1 kHz, interpolated from 500 Hz",
            "xhtsansiro/A_Dynamical-System-Approach-to-Shared-Control",
            "MIT",
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
            "a person guides a Franka arm with a force sensor at its wrist along a printed symbol; frame and sign of "
            "the force are not documented",
            "1 kHz with lost samples, 695 Hz on average",
            "AutoLabModena/Panda-Co-Manipulation-Dataset",
            "MIT",
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
    """Names of the recordings of one source, or of all.

    Raises:
        KeyError: there is no such source.
    """
    chosen = SOURCES.values() if source is None else (SOURCES[source],)
    return tuple(name for each in chosen for name in each.recordings())


def source_of(name: str) -> Source:
    """The source of a recording.

    Raises:
        KeyError: there is no recording of that name.
    """
    for source in SOURCES.values():
        if name in source.recordings():
            return source
    raise KeyError(f"{name}: no shipped recording; those of {', '.join(SOURCES)} are")


def load(name: str) -> Trace:
    """A recording: position [m] and force [N] on the operator's side of the contact (the reaction), unfiltered.

    Raises:
        KeyError: there is no recording of that name.
    """
    return as_trace(archive.read(source_of(name).archive, name))


@cache
def _members(source: Source) -> tuple[str, ...]:
    return tuple(archive.names(source.archive))
