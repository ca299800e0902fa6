"""What a long command shows while it works, on a terminal or without one."""

import re

import pytest

from tests.system.systems import CONFIGS
from tests.terminals import WIDTH, on_terminal
from weberlink.cli.output import progress_bar


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
