"""The `experiment` command: conducts the trials of one subject, live or in virtual time."""

import shlex
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from weberlink.config import MASTER, ConfigurationError, load
from weberlink.config.errors import require_package
from weberlink.session.recorder import format_for
from weberlink_figures.environment import environment
from weberlink_studies.experiment.conduct import Conduct, Subject, SubjectLeft, TrialRunner
from weberlink_studies.experiment.ledger import LedgerError, Resumed, opened, path_of, subjects
from weberlink_studies.experiment.plan import SCALE, TRIAL_S, TrialPlan, order
from weberlink_studies.experiment.subjects import Person, SimulatedSubject
from weberlink_studies.experiment.trial_runner import LiveRunner, Ports, TrialSignals, VirtualRunner

SEED = 0  # default seed of the orders of trials


@dataclass(frozen=True)
class ExperimentRequest:
    """The command line."""

    file: Path  # configuration of the system
    overrides: Sequence[str]  # of its keys
    folder: Path  # of the ledgers
    subject: int | None  # number; None for the next that is free
    seed: int | None  # None for that of the plan, or `SEED`
    duration_s: float | None  # length of a trial [s]; None for that of the plan, or of the paper
    simulate: bool  # whether a program rates
    record: bool  # whether a person's trials are recorded

    def again(self, subject: int) -> str:
        """The command that continues with a subject."""
        words = ["weberlink", "study", "experiment", str(self.file)]
        words += ["--subject", str(subject), "--out", str(self.folder)]
        words += ["--simulate"] if self.simulate else [] if self.record else ["--no-record"]
        return shlex.join([*words, *(word for override in self.overrides for word in ("--set", override))])


def run(
    request: ExperimentRequest, *, ports: Ports, source: TextIO, screen: TextIO, report: Callable[[int, int], None]
) -> str:
    """Start or continue an experiment; the last message, what was done or how to continue. No rating is ever lost.

    A person answers at `source` and `screen`; `ports` is called before each live session, `report` with the number of
    trials that a simulated subject has rated, and of all.
    """
    signals = TrialSignals(request.file, tuple(request.overrides))
    signals.try_out()
    if request.record and not request.simulate:  # before a number is taken
        require_package("mcap", "recording", "a recording of each trial (leave it out with --no-record)")
    analyse = f"analyse them with: weberlink study ratings {shlex.quote(str(request.folder))}"
    try:
        with opened(_path(request)) as ledger:
            if ledger.progress is None:
                progress = ledger.append(_plan(request, signals, ledger.path))
            else:
                progress = ledger.progress
                _check(request, progress.plan, signals, ledger.path)
                if not progress.remaining:
                    return f"{ledger.path}: all {len(progress.plan.trials)} trials are rated\n{analyse}"
                ledger.append(Resumed(environment=environment()))
            if ledger.set_aside is not None:
                screen.write(f"the last line was incomplete; it was moved to {ledger.set_aside}\n")
            plan = progress.plan
            subject: Subject
            runner: TrialRunner
            if request.simulate:
                subject, runner = SimulatedSubject(progress, report), VirtualRunner(signals, plan)
            else:
                subject, runner = Person(source, screen, plan.duration_s), LiveRunner(signals, plan, ports)
            recordings = _recordings(ledger.path) if request.record and not request.simulate else None
            try:
                Conduct(ledger, runner, subject, recordings).run()
            except SubjectLeft:
                return f"continue with: {request.again(plan.subject)}"
            whose = " by a program, no person" if plan.simulated else ""
            return f"{ledger.path}: {len(plan.trials)} trials rated{whose}\n{analyse}"
    except LedgerError as error:
        raise ConfigurationError(str(error)) from None


def check_device(request: ExperimentRequest) -> None:
    """See that a person can feel the trials."""
    configuration = load(request.file, request.overrides, [MASTER])
    # A device that a program moves, so that no person feels anything with it, says `SCRIPTED = True`.
    is_scripted = configuration.device is not None and getattr(configuration.device.driver, "SCRIPTED", False)
    if not request.simulate and is_scripted:
        driver = configuration.system.master.device.driver
        raise ConfigurationError(
            f"{request.file}: master.device.driver: a program moves {driver}, so no person would feel the trials; name "
            "the driver of a device (weberlink device list), or add --simulate to let a program rate"
        )


def _path(request: ExperimentRequest) -> Path:
    """The ledger of the subject asked for, or a new one of the next free number."""
    request.folder.mkdir(parents=True, exist_ok=True)
    if request.subject is not None:
        return path_of(request.folder, request.subject, simulated=request.simulate)
    while True:
        known = subjects(request.folder, simulated=request.simulate)
        path = path_of(request.folder, max(known, default=0) + 1, simulated=request.simulate)
        with suppress(FileExistsError):  # another experiment took the number
            path.touch(exist_ok=False)
            return path


def _plan(request: ExperimentRequest, signals: TrialSignals, path: Path) -> TrialPlan:
    subject = int(path.stem.rpartition("-")[2])
    seed = SEED if request.seed is None else request.seed
    return TrialPlan(
        subject=subject,
        simulated=request.simulate,
        seed=seed,
        duration_s=TRIAL_S if request.duration_s is None else request.duration_s,
        digest=signals.digest,
        configuration=signals.document,
        wording=SCALE,
        trials=order(seed, subject),
        environment=environment(),
    )


def _check(request: ExperimentRequest, plan: TrialPlan, signals: TrialSignals, path: Path) -> None:
    """Check that this is the experiment of the ledger."""
    advice = "continue with the same settings, or begin another subject (without --subject)"
    if fields := signals.changes(plan):
        raise ConfigurationError(f"{path}: was begun with another configuration ({fields}); {advice}")
    if request.duration_s is not None and request.duration_s != plan.duration_s:
        raise ConfigurationError(f"{path}: was begun with trials of {plan.duration_s:g} s; {advice}")
    if request.seed is not None and request.seed != plan.seed:
        raise ConfigurationError(f"{path}: was begun with seed {plan.seed}; {advice}")
    if plan.simulated != request.simulate:
        whose = "a program" if plan.simulated else "a person"
        raise ConfigurationError(f"{path}:1: is the ledger of {whose}, which does not match its file name; rename it")


def _recordings(ledger: Path) -> Path:
    """The folder of a subject's recordings."""
    folder = ledger.with_suffix("")
    folder.mkdir(exist_ok=True)
    format_for(folder / "any.mcap")
    return folder
