"""The public names of the library, and the examples of docs/library.md and docs/start/scene.md."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import weberlink
from tests.program import weberlink as run

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^## (.*?)\n.*?```python\n(.*?)```", PAGE, flags=re.DOTALL | re.MULTILINE)
LIMIT_US = 20_000  # limit of the import time; 1,800 to 2,100 us were measured on two busy cores


def test_every_public_name_is_there_and_documented() -> None:
    for name in weberlink.__all__:
        assert getattr(weberlink, name) is not None
        assert re.search(rf"\b{name}\b", PAGE) or name in ("__version__", "Channel", "Coded", "Trace")
    assert PAGE.count("```python") == len(BLOCKS)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        weberlink.nothing  # noqa: B018


def test_importing_the_package_loads_nothing_else() -> None:
    script = "import sys; before = set(sys.modules); import weberlink; print(*sorted(set(sys.modules) - before))"
    run = subprocess.run([sys.executable, "-X", "importtime", "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["weberlink"]
    (line,) = [line for line in run.stderr.splitlines() if line.endswith("weberlink")]
    assert int(line.split("|")[1]) < LIMIT_US


@pytest.mark.parametrize(("title", "source"), BLOCKS, ids=[title for title, _ in BLOCKS])
def test_example_of_the_documentation_runs(title: str, source: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    exec(compile(source, f"docs/library.md: {title}", "exec"), {"__name__": "example"})


def test_the_scene_of_the_page_is_complete_and_is_touched(tmp_path: Path) -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "start" / "scene.md").read_text("utf-8"), re.S)
    path = tmp_path / "mine.yaml"
    path.write_text(example, encoding="utf-8")
    checked, ran = run("check", path), run("simulate", path, "--duration", 3)
    assert (checked.status, ran.status) == (0, 0), (checked, ran)
    assert "warning" not in checked.output + checked.errors
    assert ran.output.startswith(("good", "ended"))  # as the guest, or the kernel alone reports
