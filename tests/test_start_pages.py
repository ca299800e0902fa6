"""What docs/start/ shows works as it stands there."""

import re
from pathlib import Path

from tests.program import COMMANDS, weberlink
from weberlink.installation import guests

ROOT = Path(__file__).parents[1]


def test_the_scene_of_the_page_is_complete_and_is_touched(tmp_path: Path) -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "start" / "scene.md").read_text("utf-8"), re.S)
    path = tmp_path / "mine.yaml"
    path.write_text(example, encoding="utf-8")
    checked, ran = weberlink("check", path), weberlink("simulate", path, "--duration", 3)
    assert (checked.status, ran.status) == (0, 0), (checked, ran)
    assert "warning" not in checked.output + checked.errors
    assert ran.output.startswith("good")


def test_commands_and_options_of_the_pages_are_there() -> None:
    text = "\n".join(page.read_text("utf-8") for page in sorted((ROOT / "docs" / "start").glob("*.md")))
    named = re.findall(r"^weberlink ([a-z]+)([^\n#]*)", text, re.M)
    assert {name for name, _ in named} >= {"keygen", "check", "doctor", "slave", "master", "simulate", "try"}
    for name, rest in named:
        assert name in COMMANDS or name in guests("weberlink.commands"), name
        if name not in COMMANDS:
            continue
        options = {option for parameter in COMMANDS[name].params for option in parameter.opts}
        assert set(re.findall(r"(?<!\w)--[a-z-]+", rest)) <= options, (name, rest)
