"""The emulated faults of what a side sends, which may change while a session runs."""

from collections.abc import Mapping

from pydantic import ValidationError

from weberlink.config.errors import describe
from weberlink.config.model import DirectionFaults
from weberlink.protocol.emulation import EmulatedLink
from weberlink.protocol.events import Address
from weberlink.session.composition.link import emulation_of

LINK_SETTINGS = ("delay_ms", "jitter_ms", "loss")
"""What may be changed; as of `link.emulate`."""


class LiveLink:
    """The emulated link of one direction, and its present faults.

    Args:
        faults: of the file.
        link: what carries the datagrams.
        fixed: why nothing may be changed; None if it may.
    """

    def __init__(self, faults: DirectionFaults, link: EmulatedLink[Address], fixed: str | None = None) -> None:
        self.link = link
        self._faults = {name: getattr(faults, name) for name in DirectionFaults.model_fields}
        self._fixed = fixed

    @property
    def in_force(self) -> dict[str, float]:
        return {name: self._faults[name] for name in LINK_SETTINGS}

    def change(self, settings: Mapping[str, object]) -> str | None:
        """Apply settings to what is sent from now on; why not, or None.

        What is under way arrives as before, and what is sent later does not overtake it.
        """
        if self._fixed is not None:
            return self._fixed
        if unknown := [name for name in settings if name not in LINK_SETTINGS]:
            return f"{unknown[0]} is no setting of the link; known are {', '.join(LINK_SETTINGS)}"
        try:
            faults = DirectionFaults.model_validate(self._faults | dict(settings), strict=True)
            self.link.change(emulation_of(faults))
        except ValidationError as error:
            return describe(error, DirectionFaults, ())
        except ValueError as error:  # of several settings, such as a loss that these bursts cannot have
            return str(error)
        self._faults = dict(faults)
        return None
