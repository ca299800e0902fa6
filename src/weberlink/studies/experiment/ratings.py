"""The `ratings` command: the ledgers of an experiment into an analysis, its tables and its figures."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from weberlink.studies.experiment.analysis import SEED, Analysis, analyse
from weberlink.studies.experiment.answers import Whose, gather
from weberlink.studies.experiment.ledger import LedgerError
from weberlink.studies.experiment.scale import HIGHEST, LOWEST
from weberlink.studies.experiment.table import table_of
from weberlink.system.configuration import ConfigurationError
from weberlink.system.environment import environment, footer
from weberlink.system.extras import need


@dataclass(frozen=True)
class Ratings:
    """An analysed study, and how it is shown."""

    analysis: Analysis
    facts: dict[str, Any]

    @property
    def document(self) -> dict[str, Any]:
        return self.analysis.document | {"environment": self.facts}

    @property
    def table(self) -> Table:
        return table_of(self.analysis, footer(self.facts, SEED))

    def draw(self, folder: Path) -> None:
        """Write the three figures of the paper, and their points as CSV.

        Raises:
            OSError: if the folder or a file in it cannot be made.
        """
        from weberlink.studies.curve_figures import QualityAxis, draw_curves  # noqa: PLC0415 - heavy, and seldom wanted

        folder.mkdir(parents=True, exist_ok=True)
        draw_curves(
            self.analysis.curves,
            folder,
            quality=QualityAxis(label="rating", better="higher", limits=(LOWEST, HIGHEST), column="rating"),
            caption=footer(self.facts, SEED),
            title=self.analysis.who,
            mark=self.analysis.mark,
            units="simulated subjects" if self.analysis.mark else "subjects",
        )

    def write_csv(self, path: Path) -> None:
        """Every rating, for programs of statistics.

        Raises:
            OSError: if the file cannot be written.
        """
        self.analysis.answers.write_csv(path)


def run(folder: Path, *, level: float, only: str | None, plots: bool) -> Ratings:
    """Analyse a folder of ledgers.

    Args:
        folder: as `experiment --out` made it.
        level: rating at which packets are compared.
        only: "people" or "simulated"; None where there is one kind.
        plots: whether figures will be wanted.

    Raises:
        ConfigurationError: for an argument or a ledger that cannot be used, or a missing package.
    """
    need("scipy", "statistics", "ratings")
    if plots:
        need("matplotlib", "plots", "--plots")
    if not folder.is_dir():
        raise ConfigurationError(f"{folder}: no such folder; expected the one that experiment --out named")
    try:
        answers = gather(folder, _whose(only))
    except LedgerError as error:
        raise ConfigurationError(str(error)) from None
    return Ratings(analyse(answers, level), environment())


def _whose(only: str | None) -> Whose | None:
    kinds: dict[str, Whose] = {"people": "people", "simulated": "simulated"}
    if only is not None and only not in kinds:
        raise ConfigurationError(f"--only: expected people or simulated, not {only!r}")
    return None if only is None else kinds[only]
