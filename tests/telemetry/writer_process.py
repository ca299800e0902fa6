"""A process that writes a ring: `writer_process.py PATH SIDE COUNT CAPACITY PERIOD_S`.

COUNT records and then, when its input ends, an end in order; or 0 for no end. Record i holds i in every number and i
modulo 251 in every byte; `at` is its deadline, or i without a period.
"""

import sys
import time

from weberlink.telemetry.record import FIELDS
from weberlink.telemetry.ring import RingWriter

path, side, count, capacity, period = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), float(sys.argv[5])
is_byte = [field.kind == "u1" for field in FIELDS for _ in range(field.axes)][1:]

with RingWriter(path, side=side, rate_hz=1000.0, capacity=capacity) as writer:
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    began = time.monotonic()
    i = 0
    while not count or i < count:
        at = began + i * period
        if period and (wait := at - time.monotonic()) > 0.0:
            time.sleep(wait)
        byte = i % 251
        writer.write([at if period else i, *(byte if each else i for each in is_byte)])
        i += 1
    sys.stdin.read()
