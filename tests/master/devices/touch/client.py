"""A program on pyOpenHaptics alone, as its README has it; run as a process of its own, which finds libHD.so by itself.

Arguments: name of the device, the force [N], and for how long [s]. Prints as JSON what its callback saw last.
"""

import json
import sys
from contextlib import redirect_stdout
from time import sleep
from typing import Any

from pyOpenHaptics import hd  # type: ignore[import-untyped]
from pyOpenHaptics.hd_callback import hd_callback  # type: ignore[import-untyped]
from pyOpenHaptics.hd_device import HapticDevice  # type: ignore[import-untyped]

SEEN: dict[str, Any] = {"frames": 0}
FORCE = [float(part) for part in json.loads(sys.argv[2])]
RUN_S = float(sys.argv[3])


@hd_callback  # type: ignore[untyped-decorator]
def frame() -> None:
    transform = hd.get_transform()
    SEEN["frames"] += 1
    SEEN["position"] = [transform[3][0], transform[3][1], transform[3][2]]
    SEEN["x_axis"] = [transform[0][0], transform[0][1], transform[0][2]]
    SEEN["buttons"] = hd.get_buttons()
    SEEN["joints"], SEEN["gimbals"] = list(hd.get_joints()), list(hd.get_gimbals())
    hd.set_force(FORCE)


if __name__ == "__main__":
    with redirect_stdout(sys.stderr):
        device = HapticDevice(callback=frame, device_name=sys.argv[1], scheduler_type="async")
        SEEN["vendor"], SEEN["model"] = device.__vendor__(), device.__model__()
        sleep(RUN_S)
        device.close()
    sys.stdout.write(json.dumps(SEEN) + "\n")
