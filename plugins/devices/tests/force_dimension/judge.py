"""The judge, run with FDSDK set: forcedimension-core, bindings that others wrote, on the library file of the driver."""

from forcedimension_core import constants, runtime

from weberlink_devices.force_dimension import library
from weberlink_devices.force_dimension.options import MODELS


def kind(type_: object) -> str:
    """The C type, where an array is the pointer that it becomes."""
    name = getattr(type_, "__name__", str(type_))
    return "LP_c_double" if name.startswith("c_double_Array") else name


def compare() -> int:
    """See that calls and constants are the same; gives the number of calls."""
    for name, (result, arguments) in library.PROTOTYPES.items():
        call = getattr(runtime._libdhd, name)
        assert kind(call.restype) == kind(result), name
        assert list(map(kind, call.argtypes)) == list(map(kind, arguments)), name
    index = constants.StatusIndex
    assert library.MOST_STATUS >= constants.MAX_STATUS
    ours = (library.RESET, library.FORCE, library.WRIST_DETECTED, library.WRIST_INIT, library.FORCE_OFF_CAUSE)
    assert ours == (index.RESET, index.FORCE, index.WRIST_DETECTED, index.WRIST_INIT, index.FORCEOFFCAUSE)
    cause = constants.ForceOffCause
    assert library.OFF_BY_WATCHDOG == cause.WATCHDOG
    assert set(library.OFF_CAUSES) == set(cause) - {cause.FORCES_NOT_OFF}
    types = {type_.name.lower(): int(type_) for type_ in constants.DeviceType}
    for name, model in MODELS.items():
        plain = name.removeprefix("novint_").replace(".", "")
        assert model.types == tuple(types[each] for each in (plain, f"{plain}_right", f"{plain}_left") if each in types)
    return len(library.PROTOTYPES)


if __name__ == "__main__":
    print(compare())  # noqa: T201
