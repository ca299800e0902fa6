"""The compiled build: what is compiled, that it runs, and that the environment can choose the Python source instead."""

import importlib
import importlib.util
import os
import shutil
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from types import ModuleType

import pytest

import weberlink
from tests.program import weberlink as run
from tests.session.systems import CONFIGS
from weberlink.compiled import build, is_compiled

ROOT = Path(__file__).parents[1]
SAY = "import weberlink.update as found; print(found.__doc__)"


@pytest.fixture(scope="module")
def recipe() -> ModuleType:
    spec = importlib.util.spec_from_file_location("recipe", ROOT / "setup.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def at_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


@pytest.mark.usefixtures("at_root")
def test_the_list_names_modules_that_there_are(recipe: ModuleType) -> None:
    for pattern in recipe.COMPILED:
        assert list(recipe.SOURCE.glob(pattern)), pattern
    for left in recipe.PYTHON:
        assert any(recipe.SOURCE / left in recipe.SOURCE.glob(pattern) for pattern in recipe.COMPILED), left
        assert str(recipe.SOURCE / left) not in recipe.modules()


@pytest.mark.skipif(not is_compiled(), reason="not the compiled build")
@pytest.mark.usefixtures("at_root")
def test_every_module_of_the_list_runs_compiled(recipe: ModuleType) -> None:
    for path in recipe.modules():
        name = ".".join(Path(path).relative_to("src").with_suffix("").parts)
        assert str(importlib.import_module(name).__file__).endswith(tuple(EXTENSION_SUFFIXES)), name


@pytest.mark.parametrize("command", [["--version"], ["simulate", CONFIGS / "loopback.yaml", "--duration", "0.1"]])
def test_the_last_line_says_which_build_runs_and_how_to_get_the_other(command: list[object]) -> None:
    assert build(compiled=is_compiled()) in " ".join(run(*command).output.split())
    assert build(compiled=True) != build(compiled=False)


def test_the_environment_chooses_the_source(tmp_path: Path) -> None:
    """An extension beside a source comes first, unless `WEBERLINK_PURE` is 1; other packages keep theirs."""
    package = tmp_path / "weberlink"
    package.mkdir()
    shutil.copy(weberlink.__file__, package / "__init__.py")
    (package / "update.py").write_text('"""source"""', encoding="utf-8")
    (package / f"update{EXTENSION_SUFFIXES[0]}").write_text("damaged", encoding="utf-8")

    def run(program: str, pure: str) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {"PYTHONPATH": str(tmp_path), "WEBERLINK_PURE": pure}
        return subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False
        )

    assert "ImportError" in run(SAY, "").stderr
    assert run(SAY, "1").stdout == "source\n"
    numpy = "import weberlink, numpy._core._multiarray_umath as found; print(found.__file__)"
    assert run(numpy, "1").stdout.strip().endswith(tuple(EXTENSION_SUFFIXES))
