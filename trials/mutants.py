"""A sampled mutation test: small faults in what codes, carries, controls and protects, and which the suite notices.

    python -m trials.mutants --count 20

Each mutant is one changed operator, constant, condition or statement of the sources. The tests that mirror its file run
first, then those of its package, then sessions in virtual time or drivers, until one fails. A seed gives the same
mutants as long as the sources are the same.
"""

import argparse
import ast
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from random import Random
from typing import Any

ROOT = Path(__file__).parents[1]
SOURCES = {
    "codec": ["codec", "plugins/predictors/src"],
    "protocol": ["protocol"],
    "control": ["src/weberlink/control"],
    "ports and safety": ["master/*.py", "slave/*.py"],
    "hardware": ["src/weberlink/hardware"],
    "arms": ["src/weberlink/arms", "plugins/arms/src"],
    "devices": ["master/devices", "plugins/devices/src"],
}
"""What is mutated, by group; a drawing takes as many of each."""
NOT_MUTATED = (
    *("emulators", "emulator", "emulated_board", "handle", "emulation", "umockdev", "umockdev_service"),
    *("__main__", "__init__"),
)
TESTS = {"master": "tests/master/test_*.py", "slave": "tests/slave/test_*.py"}
"""Tests of a package, where they are not its whole folder."""
USERS = dict.fromkeys(("hardware", "polhem"), "plugins/devices/tests")
SESSIONS = "tests/session"
"""Tests of what uses a package: sessions, or the drivers that are made of it."""
TIMEOUT_S = 400.0
SWAPS: dict[type[ast.AST], type[Any]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip
CALLS = {"min": "max", "max": "min", "abs": "", "any": "all", "all": "any"}


@dataclass(frozen=True)
class Mutant:
    group: str  # of `SOURCES`
    path: str  # of the source, from the root
    line: int  # of the change, from 1
    begin: int  # characters of the source that are replaced
    end: int
    new: str  # what takes their place
    was: str  # the line
    becomes: str


def mutations(node: ast.AST, *, within: bool = False) -> Iterator[tuple[ast.AST, str]]:
    """Nodes of the functions below a node, each with what may take its place."""
    if isinstance(node, ast.Assert | ast.Raise | ast.JoinedStr):
        return
    if within:
        for new in variants(node):
            yield node, new
    children: Iterable[ast.AST] = ast.iter_child_nodes(node)
    if isinstance(node, ast.FunctionDef):
        children = node.body
    elif isinstance(node, ast.AnnAssign):
        children = [] if node.value is None else [node.value]
    elif isinstance(node, ast.If) and within:
        yield node.test, f"not ({ast.unparse(node.test)})"
    for child in children:
        yield from mutations(child, within=within or isinstance(node, ast.FunctionDef))


def variants(node: Any) -> Iterator[str]:
    match node:
        case ast.Compare():
            for index, operator in enumerate(node.ops):
                ops = [*node.ops[:index], SWAPS[type(operator)](), *node.ops[index + 1 :]]
                yield ast.unparse(ast.Compare(node.left, ops, node.comparators))
        case ast.BinOp() if type(node.op) in SWAPS:
            yield ast.unparse(ast.BinOp(node.left, SWAPS[type(node.op)](), node.right))
        case ast.BoolOp():
            yield ast.unparse(ast.BoolOp(SWAPS[type(node.op)](), node.values))
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield ast.unparse(node.operand)
        case ast.Call(func=ast.Name(id=name)) if name in CALLS:
            yield CALLS[name] + ast.unparse(node).removeprefix(name)
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            yield repr(value + 1 if isinstance(value, int) else value * 2.0 or 1.0)
        case ast.Expr(value=ast.Call()) | ast.AugAssign() | ast.Assign(targets=[ast.Attribute(), *_]):
            yield "pass"  # instead of a name that is set: it would be missing later, not a fault that could ship


def place(text: str, line: int, column: int) -> int:
    """Index of a character; columns count bytes."""
    start = sum(len(each) for each in text.splitlines(keepends=True)[: line - 1])
    return start + len(text[start:].encode()[:column].decode())


def drawn(count: int, seed: int) -> list[Mutant]:
    """Mutants of all groups in turn; at most one of each function's line."""
    random, chosen = Random(seed), []
    for group, patterns in SOURCES.items():
        paths = [
            path
            for pattern in patterns
            for path in sorted(ROOT.glob(pattern if pattern.endswith(".py") else f"{pattern}/**/*.py"))
            if not any(part in NOT_MUTATED for part in (*path.parts, path.stem))
        ]
        candidates = []
        for path in paths:
            text = path.read_text()
            for node, new in mutations(ast.parse(text)):
                begin = place(text, node.lineno, node.col_offset)  # type: ignore[attr-defined]
                end = place(text, node.end_lineno, node.end_col_offset)  # type: ignore[attr-defined]
                line = text.count("\n", 0, begin)
                was, becomes = (each.splitlines()[line].strip() for each in (text, text[:begin] + new + text[end:]))
                where = str(path.relative_to(ROOT))
                candidates.append(Mutant(group, where, line + 1, begin, end, new, was, becomes))
        random.shuffle(candidates)
        chosen.append(list({(each.path, each.line): each for each in candidates}.values()))
    return [mutant for each in zip(*chosen, strict=False) for mutant in each][:count]


def stages(mutant: Mutant, tests: Path) -> list[list[str]]:
    """Paths of tests, those that most likely notice it first."""
    parts = Path(mutant.path).with_suffix("").parts
    package = parts[2] if parts[0] == "src" else parts[0]
    folder = tests / (f"plugins/{parts[1]}/tests" if package == "plugins" else f"tests/{package}")
    if parts[:2] == ("master", "devices"):
        folder /= "devices"
    mirrored = sorted(folder.glob(f"**/test_*{parts[-1].split('_')[0]}*.py"))
    users = USERS.get("polhem" if "polhem" in parts else folder.name, SESSIONS)
    whole = sorted(tests.glob(TESTS[folder.name])) if folder.name in TESTS else [folder]
    return [[str(path.relative_to(tests)) for path in paths] for paths in (mirrored, whole, [tests / users]) if paths]


def judge(mutant: Mutant, tree: Path) -> str:
    """The first test that fails with the mutant, and passes without it; "" if none does."""
    source = tree / mutant.path
    text = source.read_text()
    broken: list[str] = []
    try:
        for paths in stages(mutant, tree):
            while True:
                source.write_text(text[: mutant.begin] + mutant.new + text[mutant.end :])
                failed = first_failure(tree, *paths, *(part for test in broken for part in ("--deselect", test)))
                source.write_text(text)
                if not failed:
                    break
                if "::" not in failed or not first_failure(tree, failed):
                    return failed  # what cannot even be collected has no test to try again
                broken.append(failed)
    except subprocess.TimeoutExpired:
        return "a test did not end"
    finally:
        source.write_text(text)
    return ""


def first_failure(tree: Path, *arguments: str) -> str:
    """The first test of these paths that fails; "" if all pass."""
    sources = [str(path) for path in (tree / "src", *sorted(tree.glob("plugins/*/src")))]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sources), "PYTHONDONTWRITEBYTECODE": "1"}
    options = ["-q", "-x", "-p", "no:cacheprovider", "-p", "no:randomly", "-m", "not realtime"]
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", *options, *arguments],
        check=False, cwd=tree, env=environment, capture_output=True, text=True, timeout=TIMEOUT_S,
    )  # fmt: skip
    if ran.returncode in (0, 5):
        return ""
    failed = [line for line in ran.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0].split(" - ")[0].partition(" ")[2] if failed else f"pytest ended with {ran.returncode}"


def grown(tree: Path) -> Path:
    """A copy of the sources and their tests."""
    tree.mkdir()
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
    subprocess.run(["xargs", "-0", "cp", "-P", "--parents", "-t", str(tree)], cwd=ROOT, input=tracked, check=True)
    return tree


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    mutants = drawn(arguments.count, arguments.seed)
    results: list[tuple[Mutant, str]] = []
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(arguments.workers) as pool:
        trees: SimpleQueue[Path] = SimpleQueue()
        for number in range(arguments.workers):
            trees.put(grown(Path(folder) / str(number)))

        def work(mutant: Mutant) -> tuple[Mutant, str]:
            tree = trees.get()
            try:
                return mutant, judge(mutant, tree)
            finally:
                trees.put(tree)

        for mutant, test in pool.map(work, mutants):
            results.append((mutant, test))
            place = f"{mutant.path}:{mutant.line}:"
            print(place, f"- {mutant.was}", f"+ {mutant.becomes}", test or "SURVIVES", sep="\n  ", flush=True)
    tried, caught = Counter(m.group for m, _ in results), Counter(m.group for m, test in results if test)
    for group, count in tried.items():
        print(f"{group:18} {caught[group]:3} of {count:3} caught")
    print(f"{'all':18} {sum(caught.values()):3} of {len(results):3} caught, seed {arguments.seed}")


if __name__ == "__main__":
    main()
