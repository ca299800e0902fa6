"""Record the live page beside the demonstration: `python -m tests.apps.monitor.moving_picture OUT.gif`."""

import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from time import sleep

from PIL import Image

from tests.apps.monitor.browser import browser
from tests.apps.monitor.monitors import Monitor
from tests.system.processes import Program

FRAMES, EVERY_S, WIDTH, COLOURS = 32, 0.15, 640, 128


def main(out: Path) -> None:
    with TemporaryDirectory() as folder, browser(Path(folder) / "profile") as page:
        page.size(1200, 760)
        page.scheme("dark")
        with Program("loopback") as program, Monitor(Path(folder), "--session", program.pid) as monitor:
            page.open(f"{monitor.url}/")
            page.wait(lambda: page.number("duration") > 9.0, "the hand on the dome")
            frames = []
            for _ in range(FRAMES):
                frames.append(page.driver.get_screenshot_as_png())
                sleep(EVERY_S)
    images = [Image.open(BytesIO(frame)).convert("RGB") for frame in frames]
    images = [image.resize((WIDTH, WIDTH * image.height // image.width)) for image in images]
    # The default method gives all its colours to shades of the background; curves and markers would be grey.
    palette = images[-1].quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE)
    pictures = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    pictures[0].save(
        out, save_all=True, append_images=pictures[1:], duration=round(1e3 * EVERY_S), loop=0, optimize=True
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
