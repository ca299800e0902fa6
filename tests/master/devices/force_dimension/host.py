"""A program that pushes with a device until it is stopped; run as a process of its own.

Arguments: options as JSON, and the force along y [N]. A line on standard input is how long the loop then stands still
[s], while the thread of the device goes on. A fault is its last line.
"""

import sys
from select import select
from time import monotonic, sleep

from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.force_dimension.device import ForceDimensionDevice
from weberlink.master.devices.force_dimension.options import ForceDimensionOptions

TICK = 0.001


def main(options: str, force: str) -> None:
    wanted = ForceDimensionOptions.model_validate_json(options)
    checked = ForceDimensionDevice.fingerprint(wanted)
    device = ForceDimensionDevice(wanted.model_copy(update={"signs_checked": checked}), TICK)
    device.open(monotonic())
    try:
        while True:
            now = monotonic()
            device.latest(now)
            device.command((0.0, float(force), 0.0), now)
            sleep(TICK)
            if select((sys.stdin,), (), (), 0.0)[0]:
                sleep(float(sys.stdin.readline()))
    except DeviceFault as fault:
        sys.stdout.write(f"{fault}\n")
    device.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
