"""A process that records noise until it cannot: `filling_process.py PATH LIMIT_BYTES`; 0 for the limit of the disk."""

import json
import resource
import sys

from tests.telemetry.recording.records import FACTS, SIDES, noise, origin
from weberlink.telemetry.recording.writer import RecordingWriter

path, limit = sys.argv[1], int(sys.argv[2])
if limit:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
errors = []
offered = 0
with RecordingWriter.create(path, FACTS) as writer:
    for side in SIDES:
        writer.add_side(origin(side))
    while len(errors) < 3:
        try:
            for seed, side in enumerate(SIDES):
                writer.write(side, noise(50, seed + 10 * (offered // 50), offered))
            writer.flush()
        except OSError as error:
            errors.append(error.strerror)
        offered += 50
sys.stdout.write(json.dumps({"errors": errors, "offered": offered, "records": writer.records, "size": writer.size}))
