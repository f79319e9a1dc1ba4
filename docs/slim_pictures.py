"""Bring the manual's pictures down to 256 colours each: a third of the bytes, and no eye sees it.

Run it after making figures: ``python docs/slim_pictures.py``. Pictures that have a palette already,
or would lose more than ``QUALITY``, are left alone, so that it may be run again at any time.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image

PICTURES = Path(__file__).parent / "img"
QUALITY = 44.0
"""dB of peak signal to noise: above it, 8-bit pictures pass for the same."""


def slim(path: Path) -> int:
    """Replace a picture by one with a palette where that is smaller; return the bytes saved."""
    with Image.open(path) as picture:
        if picture.mode == "P":
            return 0
        given = Image.new("RGB", picture.size, "white")
        given.paste(picture, mask=picture.getchannel("A") if picture.mode == "RGBA" else None)
    fewer = given.quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.FLOYDSTEINBERG)
    apart = np.asarray(fewer.convert("RGB"), float) - np.asarray(given, float)
    noise = float(np.sqrt((apart**2).mean()))
    made = io.BytesIO()
    fewer.save(made, "PNG", optimize=True)
    saved = path.stat().st_size - len(made.getvalue())
    if saved <= 0 or noise > 255 / 10 ** (QUALITY / 20):
        return 0
    path.write_bytes(made.getvalue())
    return saved


if __name__ == "__main__":
    total = sum(slim(path) for path in sorted(PICTURES.rglob("*.png")))
    print(f"{total / 1e6:.1f} MB saved")
