"""A predictor, a choice and a deadband of another distribution, named in a file: those of docs/library.md."""

import json
import re
from pathlib import Path

from tests.session.packages import install, said
from tests.session.systems import CONFIGS
from weberlink.codec.choice import CHOICES

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
MODULES = {
    name: next(block for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if f"# {name}.py" in block)
    for name in ("my_predictors", "my_deadbands", "my_choices")
}
ENTRY_POINTS = re.findall(r'\[project\.entry-points\."(.*?)"\]\n(.*)\n', PAGE)
RUNS = [
    (["codec.force.bank=[zoh, damped]", "codec.position.predictor=damped"], ["zoh", "damped"], "ForceDeadband"),
    *(
        ([f"codec.force.predictor={name}", "codec.force.bank=[damped, plane]"], ["damped", "plane"], "ForceDeadband")
        for name in CHOICES
    ),
    (["codec.force.predictor=second"], ["zoh", "linear"], "ForceDeadband"),
    (["codec.force.deadband={shape: constant, bound_n: 0.1}"], None, "Constant(width=0.1)"),
]
REFUSED = {
    "codec.force.predictor=damper": "codec.force.predictor: should be 'zoh'",
    "codec.force.deadband={shape: constant, bound_n: 9}": "deadband.bound_n: should be less than or equal to 5",
}
SCRIPT = """
import json, sys
from pathlib import Path
from weberlink import ConfigurationError, load, simulate
from weberlink.session.composition.channels import streams

def run(overrides):
    try:
        configuration = load(Path("LOOPBACK"), overrides)
    except ConfigurationError as error:
        return str(error)
    sent = []
    facts = simulate(configuration, 1.0, [lambda master, slave: sent.append(int(slave["updates_sent"][-1]))])
    channel = streams(configuration.system)[1][0]
    return [facts["outcome"], sent[-1], channel.bank, repr(channel.deadband)]

print(json.dumps([run(overrides) for overrides in json.loads(sys.argv[1])]))
""".replace("LOOPBACK", str(CONFIGS / "loopback.yaml"))


def test_entries_that_are_installed_can_be_named_in_a_file_and_are_checked_as_ours(tmp_path: Path) -> None:
    text = "".join(f"[{group}]\n{line.replace(chr(34), '')}\n" for group, line in ENTRY_POINTS)
    folder = install(tmp_path, "my-codec", MODULES, text)
    asked = [*(overrides for overrides, _, _ in RUNS), *([override] for override in REFUSED)]
    found = said(folder, SCRIPT, json.dumps(asked))
    for (_, bank, deadband), (outcome, packets, used, shape) in zip(RUNS, found, strict=False):
        assert outcome == "completed" and packets > 0
        assert bank is None or used == bank
        assert deadband in shape
    for refusal, expected in zip(found[len(RUNS) :], REFUSED.values(), strict=True):
        assert expected in refusal
