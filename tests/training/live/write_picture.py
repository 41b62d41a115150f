"""The picture of the README: the live page after a port propeller was lost.

Run ``python -m tests.training.live.write_picture docs/watch.png``; it needs Chromium.
"""

import base64
import io
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

from ..commands.test_watch import served
from .browser import tab

WIDTH = 1440
HEIGHT = 830
HEALTHY = 40  # s, before the fault
SHOWN = 20  # s, after the fault
N_COLOURS = 128
SETTLE = 3.0  # s, for the last update to be drawn


def passed(seconds):
    """Whether the vehicle has travelled so long."""
    shown = "document.body.innerText.match(/([\\d.]+) s, /)"
    return f"Number({shown}[1]) >= {seconds}"


def main(path):
    with served() as address, tempfile.TemporaryDirectory() as folder:
        with tab(Path(folder), WIDTH, HEIGHT) as page:
            size = {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False}
            page.call("Emulation.setDeviceMetricsOverride", **size)
            page.call("Page.navigate", url=address)
            page.until("document.querySelectorAll('canvas').length === 7", 300.0)
            page.click("10×")
            page.click("start")
            page.until(passed(HEALTHY), 300.0)
            page.click("inject")
            page.until(passed(HEALTHY + SHOWN), 300.0)
            page.click("pause")
            page.until("document.body.innerText.toLowerCase().includes('start\\nreset')", 300.0)
            page.evaluate("document.querySelector('.q-toggle').click()")
            page.until("document.body.innerText.includes('of the healthy value')", 300.0)
            time.sleep(SETTLE)
            picture = page.call("Page.captureScreenshot", format="png")["data"]
    image = Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB")
    image.quantize(N_COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
