"""An image file from pixels."""

from pathlib import Path

import matplotlib.image
import numpy as np


def write_image(path: Path, pixels: np.ndarray) -> None:
    """Write pixels (height, width, 3) in the format of the file's suffix, and make its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    matplotlib.image.imsave(path, pixels)
