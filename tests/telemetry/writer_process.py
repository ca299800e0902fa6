"""A process that writes records as fast as it can: `writer_process.py PATH CAPACITY [PAUSE_S]`.

Record i holds i in every number and i modulo 251 in every byte.
"""

import sys
import time

from weberlink.telemetry.record import FIELDS
from weberlink.telemetry.ring import RingWriter

is_byte = [field.kind == "u1" for field in FIELDS for _ in range(field.axes)]
pause_s = float(sys.argv[3]) if len(sys.argv) > 3 else 0.0

writer = RingWriter.create(sys.argv[1], side="master", rate_hz=1000.0, capacity=int(sys.argv[2]))
sys.stdout.write("ready\n")
sys.stdout.flush()
i = 0
while True:
    byte = i % 251
    writer.write([byte if each else i for each in is_byte])
    i += 1
    if pause_s:
        time.sleep(pause_s)
