"""axe-core, which checks a page for accessibility: fetched by npm once, compared with its hash, and not distributed."""

import runpy
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path
from typing import Any

import pytest

import weberlink.apps.monitor
from tests.apps.monitor.browser import Browser

VERSION = "4.14.1"
INTEGRITY = "sha512-FHfa+lmNjQZfJz1q8wKqIDwC6DExcHt/pkjNQb09a3NPjCKg2rhu5qb2S4r76ASyFNNtuFooJpZe37OgudVGtQ=="
"""Of the package (`npm view axe-core@VERSION dist.integrity`); licence MPL-2.0."""
KEPT = Path(sys.prefix) / ".axe" / f"axe-{VERSION}.min.js"
FETCH_S = 60.0
FETCH = runpy.run_path(str(Path(weberlink.apps.monitor.__file__).parent / "page" / "vendor" / "fetch.py"))
RUN = """
const done = arguments[arguments.length - 1];
axe.run(document, {rules: {"target-size": {enabled: true}}, resultTypes: ["violations"]}).then(
  ({violations}) => done(violations.flatMap(({id, impact, nodes}) =>
    nodes.map(({html, any}) => `${impact} ${id}: ${html.slice(0, 120)} (${any[0]?.message ?? ""})`))),
  (error) => done([String(error)]),
);
"""


def source(scratch: Path) -> str:
    """The script; the test skips where it can neither be found nor fetched.

    Args:
        scratch: folder for the package.

    Raises:
        ValueError: the package is not the published one.
    """
    if not KEPT.is_file():
        KEPT.parent.mkdir(parents=True, exist_ok=True)
        KEPT.write_bytes(_fetched(scratch))
    return KEPT.read_text(encoding="utf-8")


def findings(page: Browser, script: str) -> list[str]:
    """What the checker complains of in the open page, a line each: its weight, its rule, and the element."""
    page.run(f"if (!window.axe) {{ {script} }}")
    found: Any = page.driver.execute_async_script(RUN)
    return [str(each) for each in found]


def _fetched(scratch: Path) -> bytes:
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("needs npm, to fetch axe-core: apt-get install npm")
    command = [npm, "pack", "--silent", f"axe-core@{VERSION}", "--pack-destination", str(scratch)]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=FETCH_S)
    except (OSError, subprocess.SubprocessError) as error:
        pytest.skip(f"needs the npm registry, to fetch axe-core: {error}")
    package = scratch / f"axe-core-{VERSION}.tgz"
    if (found := FETCH["integrity"](package.read_bytes())) != INTEGRITY:
        raise ValueError(f"axe-core {VERSION}: expected {INTEGRITY}, got {found}")
    with tarfile.open(package, mode="r:gz") as archive:
        script = archive.extractfile("package/axe.min.js")
        assert script is not None
        return script.read()
