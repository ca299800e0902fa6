"""A program that pushes with a Touch until it is stopped; run as a process of its own.

Arguments: options as JSON, and the force [N]. It says the process id of the servo loop, then a fault, and after closing
the device its trouble.
"""

import json
import sys
from time import monotonic, sleep

from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.touch.device import TouchDevice
from weberlink.master.devices.touch.options import TouchOptions

TICK = 0.001


def main(options: str, force: str) -> None:
    wanted = TouchOptions.model_validate_json(options)
    device = TouchDevice(wanted.model_copy(update={"signs_checked": TouchDevice.fingerprint(wanted)}), TICK)
    x, y, z = json.loads(force)
    device.open(monotonic())
    sys.stdout.write(f"{device.servo_pid}\n")
    sys.stdout.flush()
    try:
        while True:
            now = monotonic()
            device.latest(now)
            device.command((x, y, z), now)
            sleep(TICK)
    except DeviceFault as fault:
        sys.stdout.write(f"{fault}\n")
        sys.stdout.flush()
    device.close()
    sys.stdout.write(f"{device.trouble}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
