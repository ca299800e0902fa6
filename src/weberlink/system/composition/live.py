"""The settings that may change while a session lives, and what a change does on each side."""

from weberlink.codec import Encoder
from weberlink.codec.predictors import BANKS
from weberlink.control.contract import Imposable, MasterControl, SlaveControl
from weberlink.control.table import SCHEMES
from weberlink.control.tuning import Settings, Tuning
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


def build_master_tuning(system: System, control: MasterControl) -> Tuning:
    """The operator's side: its decoder needs nothing, as every update says what it is."""
    return Tuning(_of_file(system), permitted(system), lambda settings: _impose(control, settings))


def build_slave_tuning(system: System, control: SlaveControl, encoder: Encoder) -> Tuning:
    """The teleoperator's side, which encodes the force."""
    force = system.codec.force

    def apply(settings: Settings) -> None:
        deadband = force_deadband(system, settings.weber)
        chosen = range(len(force.bank)) if settings.predictor in BANKS else [force.bank.index(settings.predictor)]
        encoder.retune(deadband, chosen if force.predictor in BANKS else [0])
        _impose(control, settings)

    return Tuning(_of_file(system), permitted(system), apply)


def _of_file(system: System) -> Settings:
    force = system.codec.force
    return Settings(force.weber, force.predictor, system.control.scheme)


def _impose(control: MasterControl | SlaveControl, settings: Settings) -> None:
    if isinstance(control, Imposable):
        control.impose(None if settings.scheme == AUTO else list(SCHEMES).index(settings.scheme))
