"""Whether a device may have force, and what to tell a person about it; pure."""

from weberlink.master.devices.polhem.options import PolhemOptions
from weberlink.master.devices.polhem.parameters import Parameters


def force_allowed(options: PolhemOptions, parameters: Parameters, *, checked: str, named: bool) -> float:
    """The largest force of the device [N]; 0 unless its signs were checked with just these settings.

    Args:
        options: of the driver.
        parameters: of its mechanism.
        checked: fingerprint of the settings.
        named: whether the file says which device it is.

    Raises:
        ValueError: the file asks for more force than the makers publish.
    """
    published = parameters.force_n
    if options.force_n is not None and options.force_n > published:
        raise ValueError(
            f"force_n: expected at most {published:g} N, which is published for {parameters.name}, "
            f"got {options.force_n:g}"
        )
    if not named or options.signs_checked != checked:
        return 0.0
    return published if options.force_n is None else options.force_n


def notes_of(
    name: str, options: PolhemOptions, parameters: Parameters, force_n: float, *, named: bool
) -> tuple[str, ...]:
    """What to say before a run: why there is no force, where the handle has to be, what is doubtful."""
    notes = []
    if not named:
        notes.append("no force: the file does not say which device it is; set master.device.model")
    elif force_n == 0.0:
        stale = "" if options.signs_checked is None else " with these settings"
        notes.append(f"no force: signs not checked{stale}; run: weberlink device test {name}")
    if options.homing == "at_open":
        notes.append("hold the handle in its home pose while the run starts")
    elif options.homing == "button":
        notes.append("press the calibration button in the home pose when the run starts")
    return (*notes, *(parameters.warnings if named else ()))
