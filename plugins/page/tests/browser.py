"""A real browser without a screen, for the tests of the page: Debian's Chromium, driven by its own driver."""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.wait import until

CHROMIUM = shutil.which("chromium")
DRIVER = shutil.which("chromedriver")
SCHEMES_OF_THE_NETWORK = {"http", "https", "ws", "wss"}


class Browser:
    """One page at a time; the driver is that of selenium."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver
        self._console: list[str] = []
        self._requests: list[str] = []

    def open(self, address: str) -> None:
        self.driver.get("about:blank")
        self._read()
        self._console.clear()
        self._requests.clear()
        self.driver.get(address)

    def size(self, width: int, height: int) -> None:
        self.driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
        )

    def scheme(self, name: str) -> None:
        features = [{"name": "prefers-color-scheme", "value": name}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})

    def run(self, script: str, *arguments: object) -> Any:
        return self.driver.execute_script(script, *arguments)

    def text(self, name: str) -> str:
        return str(self.run("return document.getElementById(arguments[0]).innerText", name))

    def data(self, name: str, key: str = "value") -> str:
        return str(self.run("return document.getElementById(arguments[0]).dataset[arguments[1]] ?? ''", name, key))

    def picked(self, name: str) -> str:
        return str(self.run("return document.getElementById(arguments[0]).value", name))

    def number(self, name: str) -> float:
        """The exact figure beside the rounded text of an element; NaN while there is none."""
        return float(self.data(name) or "nan")

    wait = staticmethod(until)

    def click(self, selector: str) -> None:
        self.driver.find_element("css selector", selector).click()

    def choose(self, name: str, value: str) -> None:
        """As a person does: sets a control, which then says that it has changed."""
        self.run(
            "const e = document.getElementById(arguments[0]); e.value = arguments[1];"
            "for (const kind of ['input', 'change']) e.dispatchEvent(new Event(kind, {bubbles: true}))",
            name,
            value,
        )

    def pixels(self, selector: str) -> int:
        count = self.run(
            "const c = document.querySelector(arguments[0]); const d = document.createElement('canvas');"
            "d.width = c.width; d.height = c.height; const x = d.getContext('2d'); x.drawImage(c, 0, 0);"
            "return new Set(new Uint32Array(x.getImageData(0, 0, d.width, d.height).data.buffer)).size",
            selector,
        )
        return int(count)

    def console(self) -> list[str]:
        """Errors and warnings since the page was opened, but for what a graphics driver says of its speed."""
        self._read()
        return list(self._console)

    def hosts(self) -> set[str]:
        self._read()
        parts = [urlsplit(address) for address in self._requests]
        return {part.netloc for part in parts if part.scheme in SCHEMES_OF_THE_NETWORK}

    def _read(self) -> None:
        for entry in self.driver.get_log("browser"):
            if entry["level"] in ("SEVERE", "WARNING") and "GL Driver Message" not in entry["message"]:
                self._console.append(f"{entry['level']}: {entry['message']}")
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                self._requests.append(message["params"]["request"]["url"])
            elif message["method"] == "Network.webSocketCreated":
                self._requests.append(message["params"]["url"])


@contextmanager
def browser(profile: Path, *, webgl: bool = True) -> Iterator[Browser]:
    """A browser of its own, with a profile of its own; skips where there is none."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium: pip install -e '.[dev]'")
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("needs a browser and its driver: apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--disable-background-networking",
        "--no-first-run",
        "--hide-scrollbars",
        f"--user-data-dir={profile}",
        "--disable-gpu",
        "--enable-unsafe-swiftshader" if webgl else "--disable-3d-apis",
    ):
        options.add_argument(argument)
    driver = webdriver.Chrome(options, webdriver.ChromeService(DRIVER))
    try:
        yield Browser(driver)
    finally:
        driver.quit()
