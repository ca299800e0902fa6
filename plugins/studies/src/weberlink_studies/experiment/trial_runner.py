"""Runs a trial: a configuration under one condition, live with two processes or in virtual time."""

import json
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from weberlink.config import SIDES, Configuration, ConfigurationError, load
from weberlink.session.advice import dry_run
from weberlink.session.launcher import LiveRun
from weberlink.session.simulation import build_simulation
from weberlink_figures.reporting import FiguresReport
from weberlink_figures.session import score_of
from weberlink_figures.tree import Figures, to_json
from weberlink_studies.experiment.conduct import Elapsed, FeltTrial, TrialResult
from weberlink_studies.experiment.plan import REFERENCES, CodingCondition, TrialPlan
from weberlink_studies.paper.claims import PREDICTORS

STOPPED = ("interrupted", "terminated", "hung up")  # outcomes of an interrupted session
INTERRUPTING = ("silence", "device", "refused")
"""Faults that fade the force, so that the trial does not show the coding alone."""
FIGURES = (
    "samples", "packets_per_s", "reduction", "error_rms", "error_max", "violation_fraction",
    "error_rms_jnd", "log_error_rms_jnd", "jump_median_jnd", "jump_p99_jnd", "jump_max_jnd",
)  # fmt: skip
"""Figures of the force channel that are stored with each rating."""
WHERE = ("listen", "slave", "key_file")  # keys of the link that do not change the felt signal
PER_TRIAL = ("predictor", "weber")  # keys of `codec.force` that each trial sets
UNDISTURBED = (
    "codec.force.floor_n=0",
    "codec.force.deadband={shape: isotropic}",
    "codec.force.smooth_ms=0",
    "codec.force.max_updates_per_s=null",
    "codec.position.weber=0",
    "codec.position.bound_m=0",
    "codec.position.max_updates_per_s=null",
)
"""Overrides with which every sample of force and position is sent, beside a Weber factor of 0."""
UNDISTURBED_ROTATION = (
    "codec.rotation.torque.weber=0",
    "codec.rotation.torque.floor_nm=0",
    "codec.rotation.torque.max_updates_per_s=null",
    "codec.rotation.orientation.weber=0",
    "codec.rotation.orientation.bound_rad=0",
    "codec.rotation.orientation.max_updates_per_s=null",
)
"""The same of a file with six degrees of freedom."""

Ports = Callable[[], Sequence[str]]  # returns overrides with a free port, if the file leaves it open


@dataclass(frozen=True)
class TrialSignals:
    """The configuration of the trials."""

    file: Path  # the configuration
    overrides: tuple[str, ...]  # of the command line

    @property
    def document(self) -> dict[str, Any]:
        """The resolved configuration without addresses and without the keys that each trial sets."""
        return _document(load(self.file, self.overrides))

    @property
    def digest(self) -> str:
        return _digest(self.document)

    def try_out(self) -> None:
        """Check the file before the first trial."""
        every = (CodingCondition(predictor, 0.1) for predictor in PREDICTORS)
        for condition in (*every, *(reference.condition for reference in REFERENCES)):
            dry_run(load(self.file, self.with_condition(condition)))

    def with_condition(self, condition: CodingCondition, *further: str) -> list[str]:
        """Overrides for a condition."""
        coding = [f"codec.force.predictor={condition.predictor}", f"codec.force.weber={condition.weber:g}"]
        if condition.weber == 0.0:
            rotates = load(self.file, self.overrides).system.codec.rotation is not None
            coding += UNDISTURBED + (UNDISTURBED_ROTATION if rotates else ())
        return [*self.overrides, *coding, *further]

    def changes(self, plan: TrialPlan) -> str:
        """The fields that differ from those of a plan, in words; empty if none does."""
        document = self.document
        if _digest(document) == plan.digest:
            return ""
        return ", ".join(differences(plan.configuration, document)) or "its files"

    def check(self, plan: TrialPlan) -> None:
        """Check that the file was not edited during the experiment."""
        if fields := self.changes(plan):
            raise ConfigurationError(
                f"{self.file}: was changed during the experiment ({fields}); restore it and continue"
            )


@dataclass(frozen=True)
class LiveRunner:
    """Runs trials in real time, with both sides as processes on this host."""

    signals: TrialSignals
    plan: TrialPlan
    ports: Ports

    def feel(self, trial: FeltTrial, recording: Path | None, elapsed: Elapsed) -> TrialResult:
        self.signals.check(self.plan)
        overrides = self.signals.with_condition(trial.condition, *self.ports())
        configuration = load(self.signals.file, overrides)
        report = FiguresReport(configuration, SIDES)
        display, duration = partial(nullcontext, lambda _: elapsed(report.score.duration_s)), self.plan.duration_s
        with LiveRun(configuration, overrides, SIDES, duration, display, recording, lambda: report) as run:
            run.run()
        assert report.ended is not None
        return _felt(report.ended)


@dataclass(frozen=True)
class VirtualRunner:
    """Runs trials in virtual time; hand and link have another seed in each trial."""

    signals: TrialSignals
    plan: TrialPlan

    def feel(self, trial: FeltTrial, recording: Path | None, elapsed: Elapsed) -> TrialResult:  # noqa: ARG002
        self.signals.check(self.plan)
        configuration = load(self.signals.file, self.signals.with_condition(trial.condition))
        assert configuration.device is not None
        text = f"{self.plan.seed}/{self.plan.subject}/{trial.number}"
        seed = int.from_bytes(sha256(text.encode()).digest()[:4], "big")
        seeds = [f"master.device.seed={seed}"] if "seed" in type(configuration.device.options).model_fields else []
        seeds += [f"link.emulate.seed={seed}"] if configuration.system.link.emulate is not None else []
        configuration = load(self.signals.file, self.signals.with_condition(trial.condition, *seeds))
        simulation, score = build_simulation(configuration), score_of(configuration.system)
        simulation.run(self.plan.duration_s, [score.add])
        sides = {"master": simulation.master, "slave": simulation.slave}
        failures = "; ".join(side.failure for side in sides.values() if side.failure is not None)
        outcome = f"failed: {failures}" if failures else "completed"
        faults = {name: side.faults for name, side in sides.items()}
        return _felt(replace(score.figures(), faults=faults, outcome=outcome))


def _felt(figures: Figures) -> TrialResult:
    """The stored figures of a session, and whether it can be rated."""
    force, outcome, faults = to_json(figures.felt), figures.outcome, figures.faults
    kept = {"outcome": outcome, "duration_s": figures.duration_s, "faults": faults}
    kept |= {name: force[name] for name in FIGURES}
    if figures.recording is not None:
        kept["recording_outcome"] = figures.recording.get("outcome")
    met = [f"{side} {fault}" for side, found in faults.items() for fault in found if fault in INTERRUPTING]
    problem = None
    if outcome != "completed":
        problem = str(outcome)
    elif not force["samples"] or force["error_rms"] is None:
        problem = "the two sides did not connect"
    elif met:
        problem = f"the force was interrupted ({', '.join(met)})"
    return TrialResult(kept, problem, outcome in STOPPED)


def _document(configuration: Configuration) -> dict[str, Any]:
    system = configuration.system.model_dump()
    for key in WHERE:
        del system["link"][key]
    for key in PER_TRIAL:
        del system["codec"]["force"][key]
    for side, name, part in (("master", "device", configuration.device), ("slave", "robot", configuration.robot)):
        assert part is not None
        system[side][name] = {"driver": system[side][name]["driver"]} | part.options.model_dump()
    document: dict[str, Any] = json.loads(json.dumps(system, default=_content))
    return document


def _content(value: object) -> str:
    """A file by its name and the digest of its content."""
    if not isinstance(value, Path):
        return str(value)
    return f"{value.name} {sha256(value.read_bytes()).hexdigest()}" if value.is_file() else value.name


def _digest(document: dict[str, Any]) -> str:
    return sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def differences(a: Any, b: Any, where: tuple[str, ...] = ()) -> Iterable[str]:
    """Paths of the fields in which two documents differ."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in sorted({*a, *b}):
            yield from differences(a.get(key), b.get(key), (*where, key))
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for index, (left, right) in enumerate(zip(a, b, strict=True)):
            yield from differences(left, right, (*where, str(index)))
    elif a != b:
        yield ".".join(where)
