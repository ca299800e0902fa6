"""A process that presses on the ground with an arm, until it is killed or the arm has a fault, which it prints.

Run with the port of the arm as its argument.
"""

import sys
from time import monotonic, sleep
from typing import Final

from weberlink.slave.robots.contract import RobotFault
from weberlink.slave.robots.dynamixel.driver import DynamixelRobot
from weberlink.slave.robots.dynamixel.options import DynamixelOptions

GROUND_M: Final = 0.1
GOAL_M: Final = (0.2, 0.02, GROUND_M - 0.02)
TICK_S: Final = 0.001


def main(port: str) -> None:
    robot = DynamixelRobot(DynamixelOptions(port=port, approach_m_s=0.5), None, TICK_S)
    try:
        robot.open(monotonic())
        while True:
            robot.command(GOAL_M, monotonic())
            robot.latest(monotonic())
            sleep(TICK_S)
    except RobotFault as fault:
        sys.stdout.write(f"{fault}\n")
    finally:
        robot.close()


if __name__ == "__main__":
    main(sys.argv[1])
