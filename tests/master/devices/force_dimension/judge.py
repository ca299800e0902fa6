"""The judge: forcedimension-core, the bindings that others wrote, on the same library file as the driver.

Run as a process of its own with FDSDK set; prints what it sees as JSON. An assertion says where the driver's calls or
constants differ from the bindings'.
"""

import json
import sys

from forcedimension_core import constants, containers, dhd, runtime

from weberlink.master.devices.force_dimension import library
from weberlink.master.devices.force_dimension.models import MODELS


def kind(type_: object) -> str:
    """The C type, where an array is the pointer that it becomes."""
    name = getattr(type_, "__name__", str(type_))
    return "LP_c_double" if name.startswith("c_double_Array") else name


def compare() -> int:
    """See that calls and constants are the same; returns the number of calls."""
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


def use(force: list[float]) -> dict[str, object]:
    """Open the first device, push with a force [N], read everything back, and set a time limit of 20 ms."""
    device = dhd.open()
    if device < 0:
        return {"opened": False, "error": dhd.errorGetLastStr()}
    position, status = containers.Vec3(), containers.Status()
    frame = [[0.0] * 3 for _ in range(3)]
    done = [dhd.enableForce(True, device)]
    done.append(dhd.setForceAndTorqueAndGripperForce(force, [0.0, 0.0, 0.0], 0.0, device))
    done.append(dhd.getPositionAndOrientationFrame(position, frame, device))
    done.append(dhd.getStatus(status, device))
    dhd.expert.enableExpertMode()
    told = dhd.expert.setWatchdog(160, device), dhd.expert.getWatchdog(device)  # last: until here a force may stand
    dhd.expert.disableExpertMode()
    return {
        "opened": True,
        "count": dhd.getDeviceCount(),
        "serial": dhd.getSerialNumber(device),
        "type": dhd.getSystemType(device).name,
        "watchdog": told,
        "done": done,
        "position": list(position),
        "frame": frame,
        "buttons": dhd.getButtonMask(device),
        "force": status.force,
        "wrist": status.wrist_detected,
    }


if __name__ == "__main__":
    sys.stdout.write(json.dumps({"calls": compare(), **use(json.loads(sys.argv[1]))}) + "\n")
    sys.stdout.flush()
    sys.stdin.readline()
