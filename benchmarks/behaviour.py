"""Digests of sessions in virtual time: equal digests before and after a change show that behaviour is unchanged.

The sessions are every shipped configuration, of guests too, that can run in virtual time, and variants of them: one for
each predictor, deadband and control scheme, and some with a faulty or encrypted link. A digest covers every datagram of
both directions, the report without its run time, and the signal that the robot felt.

    python -m benchmarks.behaviour            compare with benchmarks/behaviour.json
    python -m benchmarks.behaviour --write    write that file
"""

import argparse
import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from tempfile import gettempdir
from typing import Any

from weberlink.codec.choice import CHOICES
from weberlink.codec.predictors import PREDICTORS
from weberlink.config import load
from weberlink.installation import config_folders
from weberlink.protocol.emulation import EmulatedLink
from weberlink.session.simulation import TraceRecorder
from weberlink_figures.reporting import simulated

FILES = {path.name: path for folder in config_folders() for path in folder.glob("*.yaml")}
STORED = Path(__file__).with_suffix(".json")
DURATION = 5.0
LIVE = {"arms-remote.yaml", "franka.yaml", "koch-so101.yaml", "phantom.yaml", "phantom-arm.yaml", "ros2.yaml"}
KEY = Path(gettempdir()) / f"weberlink-behaviour-{os.getuid()}.key"
ENCRYPTED = ("link.security=psk", f"link.key_file={KEY}")
NO_KEY = {
    "anywhere.yaml": (
        "link.finder=null",
        "link.listen=127.0.0.1:47000",
        "link.slave=127.0.0.1:47000",
        "link.security=none",
    ),
    "arms.yaml": ("link.security=none",),
    "lan.yaml": ("link.listen=127.0.0.1:47000", "link.slave=127.0.0.1:47000", "link.security=none"),
}
"""Files with a key, which differs in each run."""
LOOPBACK = {
    **{f"predictor {name}": (f"codec.force.predictor={name}",) for name in (*PREDICTORS, *CHOICES)},
    **{f"reference {name}": (f"codec.force.reference={name}",) for name in ("displayed", "sent")},
    "deadband cone": ("codec.force.deadband={shape: cone}",),
    "deadband level_crossing": ("codec.force.deadband={shape: level_crossing}",),
    "deadband velocity_adaptive": ("codec.force.deadband={shape: velocity_adaptive}",),
    "smooth updates": ("codec.force.smooth_ms=20",),
    **{
        f"scheme {name}": (f"control.scheme={name}", "link.emulate={delay_ms: 25, jitter_ms: 3, seed: 5}")
        for name in ("none", "bounded")
    },
    "faults": (
        "link.emulate={delay_ms: 12, jitter_ms: 4, loss: 0.1, burst: 3, reorder: 0.02, duplicate: 0.02, corrupt: 0.01}",
        "link.emulate.seed=3",
    ),
    **{f"position {name}": (f"codec.position.predictor={name}",) for name in ("zoh", "linear", "adaptive")},
    "look-ahead": ("codec.force.predictor=adaptive", "codec.force.lookahead_ms=10"),
    "bounded rate": ("codec.force.max_updates_per_s=3", "codec.position.max_updates_per_s=20"),
    "encrypted": ENCRYPTED,
    "encrypted, faults": (*ENCRYPTED, "link.emulate={delay_ms: 12, jitter_ms: 4, loss: 0.1, burst: 3, seed: 3}"),
}


def cases() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    for name in sorted(FILES.keys() - LIVE):
        yield name, name, NO_KEY.get(name, ())
    for name, overrides in LOOPBACK.items():
        yield f"loopback.yaml, {name}", "loopback.yaml", overrides
    for file in ("scene-height-field.yaml", "rotation.yaml", "scene-moving.yaml"):
        yield f"{file}, faults", file, LOOPBACK["faults"]
        yield f"{file}, adaptive", file, ("codec.force.predictor=adaptive",)


def digest(case: tuple[str, str, tuple[str, ...]]) -> dict[str, Any]:
    name, file, overrides = case
    datagrams, count = hashlib.sha256(), 0
    send: Callable[..., None] = EmulatedLink.send

    def observed(self: Any, data: bytes, address: Any, now: float) -> None:
        nonlocal count
        count += 1
        datagrams.update(repr((address, now)).encode() + data)
        send(self, data, address, now)

    EmulatedLink.send = observed  # type: ignore[method-assign,assignment]
    try:
        recorder = TraceRecorder()
        figures = simulated(load(FILES[file], overrides), DURATION, recorder.add)
    finally:
        EmulatedLink.send = send  # type: ignore[method-assign]
    report = json.dumps(replace(figures, run_time_s=None).to_json(), sort_keys=True, default=str)
    trace = recorder.trace
    felt = b"".join(each.tobytes() for each in (trace.time_s, trace.position_m, trace.force_n))
    return {
        "name": name,
        "datagrams": count,
        "sent": datagrams.hexdigest()[:16],
        "report": hashlib.sha256(report.encode()).hexdigest()[:16],
        "signal": hashlib.sha256(felt).hexdigest()[:16],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--write", action="store_true", help="store the digests instead of comparing them")
    parser.add_argument("--only", default="", metavar="TEXT", help="sessions whose names contain this text")
    asked = parser.parse_args()
    todo = [case for case in cases() if asked.only in case[0]]
    if not todo:
        parser.error(f"--only: no session has {asked.only!r} in its name")
    KEY.unlink(missing_ok=True)
    KEY.touch(0o600)
    KEY.write_text(f"weberlink-key-1 {bytes(range(32)).hex()}\n", encoding="ascii")  # the same key, the same datagrams
    with ProcessPoolExecutor(2) as pool:
        found = {each.pop("name"): each for each in pool.map(digest, todo)}
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    if asked.write:
        kept = stored if asked.only else {}
        lines = [f"{json.dumps(name)}: {json.dumps(each)}" for name, each in (kept | found).items()]
        STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
        return 0
    before = {name: each for name, each in stored.items() if asked.only in name}
    names = [*found, *(before.keys() - found.keys())]  # a session that is no longer run counts as different
    different = [name for name in names if found.get(name) != before.get(name)]
    for name in different:
        sys.stdout.write(f"different: {name}\n  before {before.get(name)}\n  now    {found.get(name)}\n")
    sys.stdout.write(f"{len(names) - len(different)} of {len(names)} sessions are the same\n")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
