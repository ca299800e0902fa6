"""A process that reads a ring without end: `reader_process.py PATH`."""

import sys

from weberlink.telemetry.reader import RingReader

reader = RingReader(sys.argv[1])
sys.stdout.write("ready\n")
sys.stdout.flush()
while True:
    reader.read()
