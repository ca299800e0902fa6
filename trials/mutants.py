"""A sampled mutation test: small faults in what codes, carries, controls and protects, and which the suite notices.

    python -m trials.mutants --count 20

Each mutant is one changed operator, constant, condition or statement of the sources. The tests that mirror its file run
first, then those of its package, then the sessions in virtual time, until one fails. A seed gives the same mutants as
long as the sources are the same. The tests of another checkout are judged with `--tests`.
"""

import argparse
import ast
import os
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from random import Random

ROOT = Path(__file__).parents[1]
SOURCES = {
    "codec": ["codec"],
    "protocol": ["protocol"],
    "control": ["src/weberlink/control"],
    "ports and safety": ["master/*.py", "slave/*.py"],
    "hardware": ["src/weberlink/hardware"],
    "arms": ["src/weberlink/arms", "plugins/arms/src"],
    "devices": ["master/devices", "plugins/devices/src"],
}
"""What is mutated, by group; a drawing takes as many of each."""
NOT_MUTATED = ("emulators", "emulator", "__main__", "__init__")
TESTS = {"master": "tests/master/test_*.py", "slave": "tests/slave/test_*.py"}
"""Tests of a package, where they are not its whole folder."""
SESSIONS = "tests/session"
TIMEOUT_S = 400.0
SWAPS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="), ast.Is: ("is", "is not"), ast.IsNot: ("is not", "is"),
    ast.In: ("in", "not in"), ast.NotIn: ("not in", "in"),
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.And: ("and", "or"), ast.Or: ("or", "and"),
}  # fmt: skip
CALLS = {"min": "max", "max": "min", "abs": "", "any": "all", "all": "any"}


@dataclass(frozen=True)
class Mutant:
    """One change of a source."""

    group: str  # of `SOURCES`
    path: str  # of the source, from the root
    line: int  # of the change, from 1
    begin: int  # characters of the source that are replaced
    end: int
    new: str  # what takes their place
    was: str  # the line
    becomes: str


class Mutations(ast.NodeVisitor):
    """All changes of the functions of one source."""

    def __init__(self, text: str) -> None:
        self.found: list[tuple[int, int, str]] = []
        self._text = text
        lengths = [len(line) for line in text.splitlines(keepends=True)]
        self._starts = [sum(lengths[:row]) for row in range(len(lengths))]
        self._depth = 0

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self._depth += 1
        for child in node.body:
            self.visit(child)
        self._depth -= 1

    def visit_Assert(self, node: ast.Assert) -> None: ...

    def visit_Raise(self, node: ast.Raise) -> None: ...

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None: ...

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_Compare(self, node: ast.Compare) -> None:
        for left, operator, right in zip([node.left, *node.comparators], node.ops, node.comparators, strict=False):
            self._swap(left, operator, right)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        self._swap(node.left, node.op, node.right)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._swap(left, node.op, right)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.Not | ast.USub):
            self._replace(self._at(node), self._at(node.operand), "")
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        if isinstance(node.func, ast.Name) and node.func.id in CALLS:
            self._replace(self._at(node.func), self._end(node.func), CALLS[node.func.id])
        self.generic_visit(node)

    def visit_If(self, node: ast.If) -> None:
        self._replace(self._at(node.test), self._end(node.test), f"not ({self._source(node.test)})")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if type(node.value) in (int, float):
            new = node.value + 1 if isinstance(node.value, int) else node.value * 2.0 or 1.0
            self._replace(self._at(node), self._end(node), repr(new))

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self._replace(self._at(node), self._end(node), "pass")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._replace(self._at(node), self._end(node), "pass")
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        if isinstance(node.targets[0], ast.Attribute):  # a name would be missing later: not a fault that could ship
            self._replace(self._at(node), self._end(node), "pass")
        self.generic_visit(node)

    def _swap(self, left: ast.AST, operator: ast.AST, right: ast.AST) -> None:
        old, new = SWAPS.get(type(operator), ("", ""))
        between = self._text[self._end(left) : self._at(right)]
        if old and old in between:
            begin = self._end(left) + between.index(old)
            self._replace(begin, begin + len(old), new)

    def _replace(self, begin: int, end: int, new: str) -> None:
        if self._depth:
            self.found.append((begin, end, new))

    def _source(self, node: ast.AST) -> str:
        return self._text[self._at(node) : self._end(node)]

    def _at(self, node: ast.AST) -> int:
        return self._place(node.lineno, node.col_offset)  # type: ignore[attr-defined]

    def _end(self, node: ast.AST) -> int:
        return self._place(node.end_lineno, node.end_col_offset)  # type: ignore[attr-defined]

    def _place(self, line: int, column: int) -> int:
        """Index of a character; columns count bytes."""
        start = self._starts[line - 1]
        return start + len(self._text[start:].encode()[:column].decode())


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
            mutations = Mutations(text := path.read_text())
            mutations.visit(ast.parse(text))
            for begin, end, new in mutations.found:
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
    whole = sorted(tests.glob(TESTS[folder.name])) if folder.name in TESTS else [folder]
    return [
        [str(path.relative_to(tests)) for path in paths] for paths in (mirrored, whole, [tests / SESSIONS]) if paths
    ]


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


def grown(folder: Path, tests: Path) -> Path:
    """A copy of the sources here with the tests of a checkout."""
    tree = folder / "tree"
    for origin, is_tests in ((ROOT, False), (tests, True)):
        tracked = subprocess.run(["git", "ls-files", "-z"], cwd=origin, capture_output=True, check=True).stdout
        for name in tracked.decode().split("\0"):
            path = origin / name
            if ("tests" in Path(name).parts) == is_tests and (path.is_symlink() or path.is_file()):
                target = tree / name
                target.parent.mkdir(parents=True, exist_ok=True)
                target.symlink_to(path.readlink()) if path.is_symlink() else target.write_bytes(path.read_bytes())
    return tree


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--tests", type=Path, default=ROOT, help="checkout whose tests are judged")
    arguments = parser.parse_args()
    mutants = drawn(arguments.count, arguments.seed)
    results: list[tuple[Mutant, str]] = []
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(arguments.workers) as pool:
        trees: SimpleQueue[Path] = SimpleQueue()
        for number in range(arguments.workers):
            trees.put(grown(Path(folder) / str(number), arguments.tests.resolve()))

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
