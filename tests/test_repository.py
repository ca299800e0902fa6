"""What the repository says of itself is so: README, schema, lock files, shipped configurations."""

import ast
import importlib
import json
import pkgutil
import re
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

from docs.generated import as_text, list_guests, schema
from weberlink.compiled import is_compiled
from weberlink.installation import GUESTS, NEEDED, all_guests

ROOT = Path(__file__).parents[1]
KERNEL = ("codec", "protocol", "master", "slave", "src/weberlink")
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
GENERATED = ("configuration.md", "command-reference.md", "datagrams.md")
"""Pages that the build of the documentation writes."""
PACKAGES = sorted(path.parent.name for path in (ROOT / "src" / "weberlink").glob("*/__init__.py"))


def test_readme_is_short_and_its_example_runs() -> None:
    assert len(README.splitlines()) <= 110
    (example,) = re.findall(r"```python\n(.*?)```", README, re.S)
    exec(compile(example, "README.md", "exec"), {})


def test_links_of_the_documents_lead_to_files() -> None:
    for page in [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("lab/*.md"), *ROOT.glob("tests/**/*.md")]:
        if "_build" in page.parts or page.name in GENERATED:
            continue
        for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8")):
            assert target in GENERATED or (page.parent / target).exists(), f"{page.name}: {target}"


def test_lines_that_install_guests_name_all_that_these_need() -> None:
    """Pip would look for the others on an index."""
    needed = json.loads(GUESTS.read_text(encoding="utf-8"))[NEEDED]
    for page in [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("plugins/*/README.md")]:
        for line in page.read_text(encoding="utf-8").splitlines():
            named = set(re.findall(r'-e "?plugins/(\w+)', line))
            assert {each for guest in named for each in needed.get(guest, "").split()} <= named, f"{page}: {line}"


def test_make_targets_that_the_documents_name_are_there() -> None:
    targets = set(re.findall(r"^([a-z]+):", MAKEFILE, re.M))
    named = []
    for document in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("**/*.md")):
        for target in re.findall(r"(?:^ {4}|`|^(?=make \w+ +#))make (\w+)", document.read_text(encoding="utf-8"), re.M):
            assert target in targets, f"{document.name}: make {target}"
            named.append(target)
    assert {"demo", "docs", "soak"} <= set(named)


@pytest.mark.skipif(is_compiled(), reason="the schema is made from the source")
@pytest.mark.skipif(
    any(find_spec(f"weberlink_{guest}") is None for guest in all_guests()), reason="it has the options of all guests"
)
def test_shipped_schema_is_that_of_the_code() -> None:
    shipped, document = (ROOT / "configs" / "weberlink.schema.json").read_text(encoding="utf-8"), schema()
    assert shipped == as_text(document), "run: make schema"
    assert json.loads(shipped) == json.loads(json.dumps(document))
    assert shipped.count("\n") < len(document["$defs"]) + len(document) + 5


def test_lock_files_pin_every_dependency() -> None:
    def pinned(name: str) -> set[str]:
        lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
        return {line.partition("==")[0].lower() for line in lines if "==" in line and not line.startswith("#")}

    def names(requirements: list[str]) -> set[str]:
        return {re.split(r"[<>=\[ ]", requirement)[0].lower() for requirement in requirements}

    needed, extras = names(PROJECT["project"]["dependencies"]), PROJECT["project"]["optional-dependencies"]
    (demo,) = re.findall("^DEMO := (.*)$", MAKEFILE, re.M)
    in_demo = needed | {"setuptools"}
    for guest in demo.split():
        project = tomllib.loads((ROOT / "plugins" / guest / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        in_demo |= {name for name in names(project["dependencies"]) if not name.startswith("weberlink")}
    assert in_demo <= pinned("requirements.lock")
    for extra in extras.values():
        needed |= names(extra)
    for path in ROOT.glob("plugins/*/src/../pyproject.toml"):
        needed |= names(tomllib.loads(path.read_text(encoding="utf-8"))["project"]["dependencies"])
    ours = {name for name in needed if name.startswith("weberlink")}
    assert needed - ours <= pinned("requirements-dev.lock")


def test_the_kernel_names_no_guest() -> None:
    """What the guests add is known by their entry points, and by a list for messages that is made of these."""
    assert GUESTS.read_text(encoding="utf-8") == list_guests(ROOT / "plugins"), "run: make schema"
    added = json.loads(GUESTS.read_text(encoding="utf-8"))
    # Common words, such as peer, and names of drivers, some of which are of the kernel.
    for group in ("weberlink.commands", "weberlink.device_commands", "weberlink.emulators"):
        del added[group]
    common = {"path", "recording", "surface"}  # keys of records and of facts too
    names = {name for entries in added.values() for name in entries} - common
    folders = {path.parents[2].name for path in ROOT.glob("plugins/*/src/../pyproject.toml")}
    assert f"\nGUESTS := {' '.join(sorted(folders))}\n" in MAKEFILE
    forbidden = re.compile(
        "|".join([*(f"weberlink_{name}" for name in folders), *(f"[\"']{name}[\"']" for name in names)])
    )
    for path in (path for folder in KERNEL for path in (ROOT / folder).rglob("*.py")):
        assert not (found := forbidden.search(path.read_text(encoding="utf-8"))), f"{path}: {found}"


def test_the_wheel_installs_one_name() -> None:
    """Package names such as `control` belong to other distributions."""
    (found,) = PROJECT["tool"]["setuptools"]["packages"]["find"]["where"]
    assert [path.name for path in (ROOT / found).iterdir() if not path.name.endswith(".egg-info")] == ["weberlink"]
    layers = " ".join(PROJECT["tool"]["importlinter"]["contracts"][0]["layers"])
    assert {f"weberlink.{name}" for name in PACKAGES} - {"weberlink.configs"} <= set(
        re.findall(r"weberlink\.\w+", layers)
    )
    banned = PROJECT["tool"]["ruff"]["lint"]["flake8-tidy-imports"]["banned-api"]
    assert {link.name for link in (ROOT / found / "weberlink").iterdir() if link.is_symlink()} <= set(banned)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_module_imports_says_what_it_is_and_exports_what_it_has(package: str) -> None:
    root = importlib.import_module(f"weberlink.{package}")
    names = [root.__name__, *(info.name for info in pkgutil.walk_packages(root.__path__, f"{root.__name__}."))]
    for name in names:
        if name.endswith("__main__"):
            continue
        module = importlib.import_module(name)
        path = Path(module.__file__ or "")  # of a compiled module the source lies beside it
        source = (path.parent / f"{path.name.partition('.')[0]}.py").read_text(encoding="utf-8")
        assert ast.get_docstring(ast.parse(source)) or not source.strip(), f"{name} has no docstring"
        for exported in getattr(module, "__all__", []):
            assert hasattr(module, exported), f"{name}.__all__ names {exported}"
