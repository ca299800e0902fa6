"""Pictures of the page for the documentation: `python -m tests.apps.monitor.moving_picture FOLDER`.

A moving one of a visitor who rubs the dome, and one of each size and theme that a page shows.
"""

import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep

from PIL import Image

from tests.apps.monitor.browser import Browser, browser
from tests.apps.monitor.visits import Visit, visit

FRAMES, EVERY_S, WIDTH, COLOURS = 32, 0.2, 640, 128
SIZES = {"desk": (1400, 900, ("dark",)), "phone": (390, 844, ("dark", "light"))}


def main(folder: Path) -> None:
    with TemporaryDirectory() as scratch, browser(Path(scratch) / "profile") as page:
        page.size(1200, 760)
        page.scheme("dark")
        with visit(page, Path(scratch)) as visitor:
            moving(visitor, folder / "demo.gif")
            for size, (width, height, schemes) in SIZES.items():
                page.size(width, height)
                for scheme in schemes:
                    page.scheme(scheme)
                    still(visitor, folder / f"page-{size}-{scheme}.png")


def moving(visitor: Visit, out: Path) -> None:
    frames: list[bytes] = []
    last = monotonic() + 2.0  # the mouse is at the dome by then

    def take() -> None:
        nonlocal last
        if monotonic() - last > EVERY_S and len(frames) < FRAMES:
            last = monotonic()
            frames.append(visitor.page.driver.get_screenshot_as_png())

    visitor.grab()
    while len(frames) < FRAMES:
        visitor.rub(8.0, take)
    visitor.release()
    images = [Image.open(BytesIO(frame)).convert("RGB") for frame in frames]
    images = [image.resize((WIDTH, WIDTH * image.height // image.width)) for image in images]
    # The default method gives all its colours to shades of the background; curves and markers would be grey.
    palette = images[-1].quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE)
    pictures = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    pictures[0].save(
        out, save_all=True, append_images=pictures[1:], duration=round(1e3 * EVERY_S), loop=0, optimize=True
    )


def still(visitor: Visit, out: Path) -> None:
    visitor.page.run("scrollTo(0, 0)")
    sleep(0.5)
    visitor.grab()
    visitor.rub(6.0)
    shrunk(visitor.page, out)
    visitor.release()


def shrunk(page: Browser, out: Path) -> None:
    image = Image.open(BytesIO(page.driver.get_screenshot_as_png())).convert("RGB")
    image.quantize(256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(out, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
