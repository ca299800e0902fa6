"""A program that pushes with a Haply until it is stopped; run as a process of its own.

Arguments: options as JSON, and the force [N]. A line on standard input is how long the loop then stands still [s],
while the thread of the device goes on. A fault is its last line.
"""

import json
import sys
from select import select
from time import monotonic, sleep

from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.haply.device import HaplyDevice
from weberlink.master.devices.haply.options import HaplyOptions

TICK = 0.001


def main(options: str, force: str) -> None:
    wanted = HaplyOptions.model_validate_json(options)
    device = HaplyDevice(wanted.model_copy(update={"signs_checked": HaplyDevice.fingerprint(wanted)}), TICK)
    x, y = json.loads(force)
    device.open(monotonic())
    try:
        while True:
            now = monotonic()
            device.latest(now)
            device.command((x, y, 0.0), now)
            sleep(TICK)
            if select((sys.stdin,), (), (), 0.0)[0]:
                sleep(float(sys.stdin.readline()))
    except DeviceFault as fault:
        sys.stdout.write(f"{fault}\n")
    device.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
