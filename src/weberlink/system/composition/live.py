"""The settings that may change while a session lives, and what a change does on each side."""

from weberlink.codec import Encoder
from weberlink.codec.predictors import BANKS
from weberlink.control.contract import Control, Imposable
from weberlink.control.table import SCHEMES
from weberlink.control.tuning import LiveSettings, Tuning
from weberlink.system.composition.channels import force_deadband
from weberlink.system.configuration import System

AUTO = "auto"


def permitted(system: System) -> dict[str, tuple[str, ...]]:
    """What may be changed in a session of this file, and to which names; k to any number from 0 to 1.

    The bank that was agreed holds every predictor that may be chosen, so an update says by its selector what it needs.
    Likewise a session of `auto` carries what every control scheme needs.
    """
    if not system.control.live_changes:
        return {}
    choices: dict[str, tuple[str, ...]] = {"weber": ()}
    force = system.codec.force
    if force.predictor in BANKS and len(force.bank) > 1:
        choices["predictor"] = (*force.bank, force.predictor)
    if system.control.scheme == AUTO:
        choices["scheme"] = tuple(SCHEMES)
    return choices


def build_tuning(system: System, control: Control, force_encoder: Encoder | None = None) -> Tuning:
    """The tuning of a side. The end that encodes the force gives its encoder; a decoder needs no tuning."""
    force = system.codec.force

    def apply(settings: LiveSettings) -> None:
        if force_encoder is not None:
            chosen = range(len(force.bank)) if settings.predictor in BANKS else [force.bank.index(settings.predictor)]
            force_encoder.retune(force_deadband(system, settings.weber), chosen if force.predictor in BANKS else [0])
        if isinstance(control, Imposable):
            control.impose(None if settings.scheme == AUTO else settings.scheme)

    return Tuning(_of_file(system), permitted(system), apply)


def _of_file(system: System) -> LiveSettings:
    force = system.codec.force
    return LiveSettings(force.weber, force.predictor, system.control.scheme)
