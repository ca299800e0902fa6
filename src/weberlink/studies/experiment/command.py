"""The `experiment` command: composes plan, ledger, subject and the sessions that are felt, live or in virtual time."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from weberlink.studies.experiment.conduct import Apparatus, Conduct, Left, Subject
from weberlink.studies.experiment.ledger import RESUMED, Ledger, LedgerError, Progress, path_of, subjects
from weberlink.studies.experiment.person import Person
from weberlink.studies.experiment.plan import TRIAL_S, Plan, order
from weberlink.studies.experiment.scale import WORDING
from weberlink.studies.experiment.simulated import SimulatedSubject
from weberlink.studies.experiment.trial_runner import Live, Ports, Signals, Virtual, differences
from weberlink.system.configuration import ConfigurationError
from weberlink.system.environment import environment
from weberlink.system.extras import need
from weberlink.system.recorder import check_target

SEED = 0
"""Of the orders of trials, if none is asked for."""


@dataclass(frozen=True)
class Request:
    """What was asked for on the command line.

    Args:
        file: configuration of the system that is felt.
        overrides: of its keys.
        folder: of the ledgers.
        subject: number; None for the next that is free.
        seed: of order and chance; None for that of the plan, or `SEED`.
        duration_s: length of a trial [s]; None for that of the plan, or of the paper.
        simulate: whether a program rates.
        record: whether a person's trials are recorded.
    """

    file: Path
    overrides: Sequence[str]
    folder: Path
    subject: int | None
    seed: int | None
    duration_s: float | None
    simulate: bool
    record: bool

    def again(self, subject: int) -> str:
        """The command that goes on with a subject."""
        words = ["weberlink", "experiment", str(self.file), "--subject", str(subject), "--out", str(self.folder)]
        words += ["--simulate"] if self.simulate else [] if self.record else ["--no-record"]
        return shlex.join([*words, *(word for override in self.overrides for word in ("--set", override))])


def run(request: Request, *, ports: Ports, source: TextIO, screen: TextIO, report: Callable[[int, int], None]) -> str:
    """Do an experiment, from its beginning or from where it was left.

    Args:
        request: what to do.
        ports: asked before each live session.
        source: what a person types.
        screen: what they see.
        report: told how many of how many trials a simulated subject has rated.

    Returns:
        What to say at the end: what is done, or how to go on.

    Raises:
        ConfigurationError: for a file, an argument or a ledger that cannot be used; nothing rated is lost.
        ConductError: if a simulated subject cannot go on.
        OSError: if a ledger cannot be written; it ends with the trial before.
    """
    signals = Signals(request.file, tuple(request.overrides))
    signals.try_out()
    if request.record and not request.simulate:  # before a number is given away
        need("mcap", "recording", "a recording of each trial (leave it out with --no-record)")
    try:
        with _open(request) as ledger:
            was_begun = ledger.progress is not None
            progress = ledger.progress or ledger.begin(_plan(request, signals, ledger.path))
            _check(request, progress.plan, signals, ledger.path)
            if progress.complete:
                return f"{ledger.path}: all {len(progress.plan.trials)} trials are rated\n{_next(request.folder)}"
            if was_begun:
                ledger.append(RESUMED, environment=environment())
            return _conduct(request, ledger, progress, signals, ports, source, screen, report)
    except LedgerError as error:
        raise ConfigurationError(str(error)) from None


def _conduct(
    request: Request,
    ledger: Ledger,
    progress: Progress,
    signals: Signals,
    ports: Ports,
    source: TextIO,
    screen: TextIO,
    report: Callable[[int, int], None],
) -> str:
    plan = progress.plan
    subject: Subject
    apparatus: Apparatus
    recordings: Path | None = None
    if request.simulate:
        subject, apparatus = SimulatedSubject(plan, report), Virtual(signals, plan)
    else:
        subject, apparatus = Person(source, screen, plan), Live(signals, plan, ports)
        recordings = _recordings(ledger.path) if request.record else None
    if ledger.set_aside is not None:
        screen.write(f"the last line was torn when the program ended; it is set aside in {ledger.set_aside}\n")
    try:
        Conduct(ledger, apparatus, subject, recordings).run()
    except Left:
        return f"continue with: {request.again(plan.subject)}"
    whose = " by a program, no person" if plan.simulated else ""
    return f"{ledger.path}: {len(progress.plan.trials)} trials rated{whose}\n{_next(request.folder)}"


def _next(folder: Path) -> str:
    return f"look at them with: weberlink ratings {shlex.quote(str(folder))}"


def _open(request: Request) -> Ledger:
    """The ledger of the subject asked for, or of the next free number.

    Raises:
        ConfigurationError, LedgerError, OSError
    """
    request.folder.mkdir(parents=True, exist_ok=True)
    if request.subject is not None:
        return Ledger(path_of(request.folder, request.subject, simulated=request.simulate))
    while True:
        known = subjects(request.folder, simulated=request.simulate)
        path = path_of(request.folder, max(known, default=0) + 1, simulated=request.simulate)
        try:
            return Ledger(path, new=True)
        except FileExistsError:  # another experiment was begun at the same moment
            continue


def _plan(request: Request, signals: Signals, path: Path) -> Plan:
    subject = int(path.stem.rpartition("-")[2])
    seed = SEED if request.seed is None else request.seed
    return Plan(
        subject=subject,
        simulated=request.simulate,
        seed=seed,
        duration_s=TRIAL_S if request.duration_s is None else request.duration_s,
        digest=signals.digest,
        configuration=signals.document,
        wording={str(level): text for level, text in WORDING.items()},
        trials=order(seed, subject),
        environment=environment(),
    )


def _check(request: Request, plan: Plan, signals: Signals, path: Path) -> None:
    """Whether this is the experiment that the ledger was begun with.

    Raises:
        ConfigurationError: it is not.
    """
    advice = "go on as it was begun, or begin another subject (without --subject)"
    if plan.digest != signals.digest:
        fields = ", ".join(differences(plan.configuration, signals.document)) or "its files"
        raise ConfigurationError(f"{path}: was begun with another configuration ({fields}); {advice}")
    if request.duration_s is not None and request.duration_s != plan.duration_s:
        raise ConfigurationError(f"{path}: was begun with trials of {plan.duration_s:g} s; {advice}")
    if request.seed is not None and request.seed != plan.seed:
        raise ConfigurationError(f"{path}: was begun with seed {plan.seed}; {advice}")
    if plan.simulated != request.simulate:
        raise ConfigurationError(f"{path}:1: a ledger of {'a program' if plan.simulated else 'a person'}; rename it")


def _recordings(ledger: Path) -> Path:
    """The folder of a subject's recordings."""
    folder = ledger.with_suffix("")
    folder.mkdir(exist_ok=True)
    check_target(folder / "any.mcap")
    return folder
