"""A program that pushes through a guarded serial port, at its path, for as long as it lives."""

import sys
from contextlib import suppress
from time import monotonic, sleep

from weberlink.hardware.fault import BadReply
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.serial_port import SerialPort

ZERO, FORCE = b"zero\n", b"force\n"
STALE_S = 0.25
"""A busy machine holds it up for less."""


def main(path: str) -> None:
    guardian = Guardian(ZERO)
    port = SerialPort(path, guardian=guardian)
    while True:
        guardian.given(monotonic(), STALE_S)
        with suppress(BadReply):
            port.write(FORCE)
        sleep(0.005)


if __name__ == "__main__":
    main(*sys.argv[1:])
