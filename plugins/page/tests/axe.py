"""axe-core, which checks a page for accessibility; `make build/page` installs it."""

from typing import Any

import pytest

from plugins.page.tests.browser import Browser
from plugins.page.tests.test_scripts import MODULES

RUN = """
const done = arguments[arguments.length - 1];
axe.run(document, {rules: {"target-size": {enabled: true}}, resultTypes: ["violations"]}).then(
  ({violations}) => done(violations.flatMap(({id, impact, nodes}) =>
    nodes.map(({html, any}) => `${impact} ${id}: ${html.slice(0, 120)} (${any[0]?.message ?? ""})`))),
  (error) => done([String(error)]),
);
"""


def findings(page: Browser) -> list[str]:
    """What the checker complains of in the open page, a line each: its weight, its rule, and the element."""
    path = MODULES / "axe-core" / "axe.min.js"
    if not path.is_file():
        pytest.skip("needs axe-core: make build/page")
    page.run(f"if (!window.axe) {{ {path.read_text(encoding='utf-8')} }}")
    found: Any = page.driver.execute_async_script(RUN)
    return [str(each) for each in found]
