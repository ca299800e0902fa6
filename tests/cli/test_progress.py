"""What a long command shows while it works, on a terminal or without one."""

import re
from pathlib import Path

import pytest
import typer

from tests.system.systems import CONFIGS
from tests.terminals import WIDTH, on_terminal
from weberlink.cli.output import progress_bar, publish
from weberlink.studies.result import StudyResult
from weberlink.system.order import INTERRUPTED


@pytest.mark.parametrize(
    ("arguments", "total"),
    [
        (("simulate", CONFIGS / "loopback.yaml", "--duration", 8), 8.0),
        (("study", "evaluate", CONFIGS / "traces" / "operator.npz", "--predictor", "zoh,linear"), None),
    ],
    ids=["simulate", "evaluate"],
)
def test_long_command_shows_its_progress(arguments: tuple[object, ...], total: float | None) -> None:
    status, lines = on_terminal(*arguments)
    assert status == 0
    assert max(map(len, lines)) <= WIDTH
    found = [re.search(r"━ ([\d.]+)/([\d.]+) ", line) for line in lines]
    told = [(float(seen[1]), float(seen[2])) for seen in found if seen]
    assert told
    assert told == sorted(told)
    assert len({of for _, of in told}) == 1
    assert total is None or told[0][1] == total
    assert not any("None" in line for line in lines)


def test_progress_without_a_terminal_is_a_line_now_and_then(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar(every_s=0.0) as report:
        report(1, 3, "problems")
        report(2, 3, "problems")
    assert capsys.readouterr() == ("", "weberlink: 1/3 problems, after 0 s\nweberlink: 2/3 problems, after 0 s\n")
    with progress_bar() as report:
        report(1, 3, "problems")
    assert capsys.readouterr() == ("", ""), "not for what is done at once"


def test_an_interrupted_study_says_that_it_draws_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit) as ended:
        publish(StudyResult({}, "", None, interrupted="1 of 2 parts"), None, tmp_path / "figures")
    assert ended.value.exit_code == INTERRUPTED
    assert capsys.readouterr().err.endswith("1 of 2 parts are done, and printed; no figures are drawn of them\n")
    assert not (tmp_path / "figures").exists()
