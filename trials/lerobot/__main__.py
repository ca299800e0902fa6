"""`python -m trials.lerobot`: both LeRobot plugins under the installed LeRobot, beside live sessions.

Runs in an environment with LeRobot, WeberLink with its guests `mujoco` and `arms`, and both plugins: `make lerobot`.
Prints what it found, writes it as JSON, and exits with status 1 if a law was violated.
"""

import argparse
import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib.metadata import version
from math import pi, sin
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np

from tests.laws import Laws, write
from trials.rig import Loopback, within
from weberlink.config import SIDES, SLAVE
from weberlink.telemetry.record import RELEASED

LED, REMOTE = "plugins/arms/configs/arms.yaml", "plugins/arms/configs/arms-remote.yaml"
FPS = 30
PIECE_S = 5.0  # length of one piece of a comparison: a ring holds 10 s
LATER_US, LATER = 100.0, 1.5  # lateness p99 beside LeRobot may be so much more, or so many times, what it is without
MISSED = 0.001  # share of ticks that may be missed in addition

Found = dict[str, Any]


def discover(laws: Laws) -> None:
    """Find both plugins as LeRobot's programs do, by the names of installed distributions."""
    from lerobot.robots import RobotConfig  # noqa: PLC0415 - only where LeRobot is
    from lerobot.teleoperators import TeleoperatorConfig  # noqa: PLC0415
    from lerobot.utils.import_utils import register_third_party_plugins  # noqa: PLC0415

    register_third_party_plugins()
    for config in (RobotConfig, TeleoperatorConfig):
        laws.check(f"weberlink is a choice of {config.__name__}", "weberlink" in config.get_known_choices())


def devices(live: Loopback, **robot: object) -> tuple[Any, Any]:
    """Robot and teleoperator of a session, made by LeRobot from their configurations."""
    from lerobot.robots import RobotConfig, make_robot_from_config  # noqa: PLC0415
    from lerobot.teleoperators import TeleoperatorConfig, make_teleoperator_from_config  # noqa: PLC0415

    of_robot, of_teleoperator = (each.get_choice_class("weberlink") for each in (RobotConfig, TeleoperatorConfig))
    return (
        make_robot_from_config(of_robot(session=live.name, **robot)),
        make_teleoperator_from_config(of_teleoperator(session=live.name)),
    )


def during(live: Loopback, run: Callable[[], object]) -> dict[str, Any]:
    """What both sides record while something runs."""
    for ring in live.sides.values():
        ring.take()
    run()
    return {side: ring.take() for side, ring in live.sides.items()}


def lateness(pieces: list[Any]) -> Found:
    """The median over the pieces, since a stall of the host spoils one piece."""
    p99 = np.median([np.percentile(piece["lateness_us"], 99) for piece in pieces])
    missed = np.median([int(piece["ticks_missed"][-1] - piece["ticks_missed"][0]) for piece in pieces])
    return {"p99_us": round(float(p99), 1), "missed": float(missed)}


def teleoperate(live: Loopback, laws: Laws, seconds: float) -> Found:
    """LeRobot's own loop, in turns with nothing, beside a session that a scripted hand leads."""
    from lerobot.processor import make_default_processors  # noqa: PLC0415
    from lerobot.scripts.lerobot_teleoperate import teleop_loop  # noqa: PLC0415

    from trials.lerobot.camera import TrialCameraConfig  # noqa: PLC0415 - needs LeRobot

    robot, teleop = devices(live, observe=True, force_window=34, cameras={"front": TrialCameraConfig()})
    names = ("teleop_action_processor", "robot_action_processor", "robot_observation_processor")
    processors = dict(zip(names, make_default_processors(), strict=True))
    took: list[float] = []

    def loop() -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            teleop_loop(teleop, robot, FPS, duration=PIECE_S, **processors)

    pieces: dict[str, list[Any]] = {"nothing": [], "LeRobot": []}
    with robot, teleop:
        features = dict(robot.observation_features)
        laws.check("a camera is an image", features.pop("front") == (48, 64, 3))
        laws.check("all other features are floats", set(features.values()) == {float}, len(features))
        for _ in range(max(1, round(seconds / PIECE_S))):
            pieces["nothing"].append(during(live, lambda: sleep(PIECE_S)))
            pieces["LeRobot"].append(during(live, loop))
        for _ in range(round(2.0 * FPS)):
            began = monotonic()
            observation, action = robot.get_observation(), teleop.get_action()
            robot.send_action(action)
            took.append(monotonic() - began)
            sleep(1.0 / FPS)
        laws.check("an observation has its features", set(observation) == set(robot.observation_features))
        laws.check("its image is the camera's", observation["front"].shape == (48, 64, 3))
        has_features = set(action) == set(teleop.action_features) == set(robot.action_features)
        laws.check("an action has its features", has_features)
        laws.check("torques are felt", any(teleop.get_feedback()))
    figures = {
        side: {beside: lateness([piece[side] for piece in of]) for beside, of in pieces.items()} for side in SIDES
    }
    for side, by in figures.items():
        without, beside = by["nothing"], by["LeRobot"]
        most = max(LATER * without["p99_us"], without["p99_us"] + LATER_US)
        is_unharmed = beside["p99_us"] <= most and beside["missed"] <= without["missed"] + MISSED * PIECE_S * 1e3
        words = ", ".join(f"{name} {each['p99_us']:g} us, {each['missed']:g} missed" for name, each in by.items())
        laws.check(f"ticks of the {side} are as late beside LeRobot as without", is_unharmed, words)
    step_ms = float(np.median(took)) * 1e3
    laws.check("a step of the loop does not wait", step_ms < 5.0, f"median {step_ms:.2f} ms")
    return {"lateness": figures, "step_median_ms": step_ms}


def record(live: Loopback, laws: Laws, folder: Path, seconds: float) -> Found:
    """An episode by `lerobot-record` without a change, and what LeRobot reads of it."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset  # noqa: PLC0415

    root = folder / "dataset"
    options = {
        "robot.type": "weberlink", "robot.observe": "true", "robot.force_window": "34", "robot.session": live.name,
        "teleop.type": "weberlink", "teleop.session": live.name, "dataset.repo_id": "local/trial",
        "dataset.root": root, "dataset.push_to_hub": "false", "dataset.num_episodes": "1", "dataset.fps": FPS,
        "dataset.episode_time_s": seconds, "dataset.reset_time_s": "0", "dataset.single_task": "follow",
        "play_sounds": "false",
    }  # fmt: skip
    command = [str(Path(sys.executable).with_name("lerobot-record")), *(f"--{k}={v}" for k, v in options.items())]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    laws.check("lerobot-record ends in order", ended.returncode == 0, ended.stderr[-500:] if ended.returncode else "")
    if ended.returncode:
        return {}
    dataset = LeRobotDataset("local/trial", root=root)
    state = np.stack([np.asarray(row) for row in dataset.hf_dataset["observation.state"]])
    names = dataset.features["observation.state"]["names"]
    windows = [i for i, name in enumerate(names) if name.count(".") == 2]
    laws.check("its frames are of 30 Hz", len(dataset) >= 0.8 * FPS * seconds, len(dataset))
    is_whole = len(windows) == 34 * (len(names) - len(windows)) / 2
    laws.check("a window holds 34 ticks of every axis", is_whole, len(windows))
    laws.check("angles and torques change in it", bool((state.std(axis=0) > 0).any()) and bool(state[:, windows].any()))
    return {"frames": len(dataset), "state": len(names), "window": len(windows)}


def lead(laws: Laws, seconds: float) -> Found:
    """A loop that sends actions moves the follower; a program that is killed leaves it at rest."""
    found: Found = {}
    with Loopback(REMOTE) as live:
        robot, _ = devices(live)
        with robot:
            home = {name: robot.get_observation()[name] for name in robot.action_features}
            wanted, sent, seen = swing(robot, home, seconds)
            most = robot.send_action(dict.fromkeys(home, 1e4))  # the last action: the follower does not go there
            laws.check("an action beyond the leader's limits is cut", max(most.values()) < 200.0, max(most.values()))
            laws.check("what is sent is returned", np.allclose(sent, np.minimum(wanted, list(most.values()))))
            spread, followed = np.ptp(sent, axis=0), np.ptp(seen, axis=0)
            follows = bool((followed > 0.8 * spread).all())
            laws.check("the follower makes the motion that is sent", follows, followed.round(1).tolist())
            lags = [lag_s(sent[:, i], seen[:, i]) for i in range(sent.shape[1])]
            laws.check("it follows within 0.3 s", max(lags) < 0.3, [round(lag, 3) for lag in lags])
            found |= {"sent_deg": spread.tolist(), "followed_deg": followed.tolist(), "lag_s": lags}
        found["released_s"] = killed(live, laws)
    laws.check("no fault was met", not any(live.summary["faults"].values()), live.summary["faults"])
    return found


def swing(robot: Any, home: dict[str, float], seconds: float) -> tuple[Any, Any, Any]:
    """Send sines about home at 0.25 Hz, each axis at another phase; what was wanted, sent and seen, by frame."""
    wanted, sent, seen, frames = [], [], [], round(seconds * FPS)
    began = monotonic()
    for frame in range(frames):
        time = frame / FPS
        share = min(1.0, time)
        goal = {
            name: angle + share * 10.0 * sin(0.5 * pi * time + axis) for axis, (name, angle) in enumerate(home.items())
        }
        wanted.append(list(goal.values()))
        sent.append(list(robot.send_action(goal).values()))
        observation = robot.get_observation()
        seen.append([observation[name] for name in home])
        sleep(max(0.0, began + (frame + 1) / FPS - monotonic()))
    return np.array(wanted), np.array(sent), np.array(seen)


def lag_s(sent: Any, seen: Any) -> float:
    """The lag at which two motions differ least, up to 1 s."""
    errors = [float(np.mean((sent[: len(sent) - lag] - seen[lag:]) ** 2)) for lag in range(FPS)]
    return int(np.argmin(errors)) / FPS


def killed(live: Loopback, laws: Laws) -> float | None:
    """Kill a process that leads through the robot's API; how long until the follower is released [s]."""
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        robot, _ = devices(live)
        robot.connect()
        home = {name: robot.get_observation()[name] for name in robot.action_features}
        os.write(writing, b"x")
        swing(robot, home, 60.0)
        os._exit(1)
    os.read(reading, 1)
    sleep(1.5)
    ring = live.sides[SLAVE]
    os.kill(pid, signal.SIGKILL)
    began = monotonic()
    os.waitpid(pid, 0)
    after = within(2.0, lambda: monotonic() - began if ring.last["ramping"] == RELEASED else None)
    laws.check("a killed program leaves the follower at rest", after is not None and after < 0.5, after)
    return after


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0, help="of teleoperation; of a lead, a third of it")
    parser.add_argument("--json", type=Path, default=None, help="write the figures here")
    arguments = parser.parse_args()
    laws = Laws()
    with tempfile.TemporaryDirectory() as name:
        os.environ |= {"HF_HOME": name, "HF_HUB_OFFLINE": "1"}
        discover(laws)
        found: Found = {"lerobot": version("lerobot"), "torch": version("torch"), "python": sys.version.split()[0]}
        with Loopback(LED) as live:
            found["teleoperate"] = teleoperate(live, laws, arguments.seconds)
            found["record"] = record(live, laws, Path(name), 5.0)
        found["session"] = {key: live.summary.get(key) for key in ("outcome", "verdict", "faults")}
        laws.check("no fault was met", not any(live.summary["faults"].values()), live.summary["faults"])
        found["lead"] = lead(laws, arguments.seconds / 3)
    found["broken"] = laws.broken
    text = json.dumps(found, indent=1)
    write(text)
    if arguments.json is not None:
        arguments.json.write_text(text + "\n", encoding="utf-8")
    return 1 if laws.broken else 0


if __name__ == "__main__":
    sys.exit(main())
