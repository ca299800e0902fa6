"""A program that pushes with a device until it is stopped; run as a process of its own.

Arguments: the driver, its options as JSON, and the force along y [N]. A line on standard input is how long the loop
then stands still [s], while the thread of the device goes on. A session that ends by a fault of the device begins
again: on a busy machine, an emulated one may be late.
"""

import sys
from contextlib import closing, suppress
from select import select
from time import monotonic, sleep
from typing import Any

from weberlink.master.devices import DEVICES
from weberlink.master.devices.contract import DeviceFault

TICK = 0.001


def main(name: str, options: str, force: str) -> None:
    driver: Any = DEVICES.load(name)
    wanted = driver.Options.model_validate_json(options)
    if hasattr(driver, "fingerprint"):
        wanted = wanted.model_copy(update={"signs_checked": driver.fingerprint(wanted)})
    device = driver(wanted, TICK)
    while True:
        with closing(device), suppress(DeviceFault):
            device.open(monotonic())
            while True:
                now = monotonic()
                device.latest(now)
                device.command((0.0, float(force), 0.0), now)
                sleep(TICK)
                if select((sys.stdin,), (), (), 0.0)[0]:
                    sleep(float(sys.stdin.readline()))


if __name__ == "__main__":
    main(*sys.argv[1:])
