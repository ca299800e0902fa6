"""A process that pushes with an arm, until it is told to end, killed, or has a fault.

    python -m plugins.arms.tests.pushing DRIVER OPTIONS VALUES

OPTIONS and VALUES, the torques of a leader or the angles of a follower, are JSON.
"""

import json
import signal
import sys
from time import monotonic, sleep
from typing import Any

from weberlink.arms.contract import ArmFault
from weberlink.master.devices import LEADERS
from weberlink.realtime.process import prepare
from weberlink.slave.robots import FOLLOWERS

TICK_S = 0.001


def main(driver: str, options: str, values: str) -> None:
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    prepare(50, lock_memory=False, cpu=None)  # as a session
    arm_class: Any = (LEADERS if driver in LEADERS else FOLLOWERS)[driver]
    arm = arm_class(arm_class.Options.model_validate_json(options), TICK_S)
    try:
        arm.open(monotonic())
        while not ended:
            arm.command(tuple(json.loads(values)), monotonic())
            arm.latest(monotonic())
            sleep(TICK_S)
    except ArmFault as fault:
        sys.stdout.write(f"{fault}\n")
    finally:
        arm.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
