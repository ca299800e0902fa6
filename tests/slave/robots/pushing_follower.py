"""A process that pushes with a follower arm on what is in its way, until it is told to end, killed, or has a fault.

    python -m tests.slave.robots.pushing_follower DRIVER OPTIONS GOAL

OPTIONS and GOAL (angles of all axes) are JSON.
"""

import json
import signal
import sys
from time import monotonic, sleep
from typing import Any

from weberlink.arms.contract import ArmFault
from weberlink.slave.robots import followers

TICK_S = 0.001


def main(driver: str, options: str, goal: str) -> None:
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    follower_class: Any = followers.load(driver)
    follower = follower_class(follower_class.Options.model_validate_json(options), TICK_S)
    angles = tuple(json.loads(goal))
    try:
        follower.open(monotonic())
        while not ended:
            follower.follow(angles, monotonic())
            follower.latest(monotonic())
            sleep(TICK_S)
    except ArmFault as fault:
        sys.stdout.write(f"{fault}\n")
    finally:
        follower.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
