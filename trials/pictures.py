"""Pictures of the page for the documentation: `python -m trials.pictures FOLDER`.

A moving one of a visitor who rubs the dome, and one of each size and theme that a page shows.
"""

import sys
from collections.abc import Iterator
from io import BytesIO
from math import cos, pi, sin
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep

from PIL import Image

from plugins.page.tests.browser import Browser, browser
from plugins.page.tests.monitors import Monitor

FRAMES, EVERY_S, WIDTH, COLOURS = 32, 0.2, 640, 128
SIZES = {"desk": (1400, 900, ("dark",)), "phone": (390, 844, ("dark", "light"))}
ABOVE_PX, DEEP_PX, WIDE_PX, ROUND_S = -10.0, 110.0, 60.0, 4.0
"""Way of the mouse from where it grabs: upwards first, then down into the dome, and to both sides in this time."""
BOX = "const b = document.querySelector('#scene canvas').getBoundingClientRect(); return [b.x, b.y, b.width, b.height]"
HELD = "return document.getElementById('scene').classList.contains('held')"


def main(folder: Path) -> None:
    with TemporaryDirectory() as scratch, browser(Path(scratch) / "profile") as page, Monitor(command="try") as monitor:
        page.size(1200, 760)
        page.scheme("dark")
        page.open(monitor.address)
        page.wait(lambda: page.data("scene") == "webgl", "the 3-D view")
        page.wait(lambda: page.data("state") in ("engaged", "released"), "the session")
        page.run("document.getElementById('anywhere').click()")
        moving(page, folder / "demo.gif")
        for size, (width, height, schemes) in SIZES.items():
            page.size(width, height)
            for scheme in schemes:
                page.scheme(scheme)
                still(page, folder / f"page-{size}-{scheme}.png")


def rub(page: Browser, seconds: float) -> Iterator[float]:
    """Press into the dome with the mouse and move to and fro; yields the time since it was pressed [s]."""
    page.run("scrollTo(0, 0)")
    left, top, width, height = page.run(BOX)

    def mouse(kind: str, right: float = 0.0, down: float = 0.0, *, pressed: bool = True) -> None:
        at = {"x": left + 0.5 * width + right, "y": top + 0.4 * height + down}
        told = {"type": kind, "clickCount": 1, "button": "left", "buttons": int(pressed)}
        page.driver.execute_cdp_cmd("Input.dispatchMouseEvent", told | at)

    def press() -> bool:
        mouse("mouseMoved", pressed=False)
        mouse("mousePressed")
        return bool(page.run(HELD))

    page.wait(press, "the handle to be held")
    began = monotonic()
    try:
        while (t := monotonic() - began) < seconds:
            down = ABOVE_PX + (DEEP_PX - ABOVE_PX) * min(1.0, t / 1.5)
            mouse("mouseMoved", WIDE_PX * sin(2.0 * pi * t / ROUND_S), down + 5.0 * cos(2.0 * pi * t / ROUND_S))
            yield t
            sleep(0.01)
    finally:
        mouse("mouseReleased", pressed=False)


def shot(page: Browser) -> Image.Image:
    return Image.open(BytesIO(page.driver.get_screenshot_as_png())).convert("RGB")


def still(page: Browser, out: Path) -> None:
    for t in rub(page, 6.0):
        if t > 3.0:
            image = shot(page)
    image.quantize(256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(out, optimize=True)


def moving(page: Browser, out: Path) -> None:
    images: list[Image.Image] = []
    last = 2.0  # the mouse is at the dome by then
    for t in rub(page, 60.0):
        if t - last > EVERY_S:
            last = t
            images.append(shot(page))
        if len(images) == FRAMES:
            break
    images = [image.resize((WIDTH, WIDTH * image.height // image.width)) for image in images]
    # The default method gives all its colours to shades of the background; curves and markers would be grey.
    palette = images[-1].quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE)
    pictures = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    pictures[0].save(
        out, save_all=True, append_images=pictures[1:], duration=round(1e3 * EVERY_S), loop=0, optimize=True
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
