"""From pixels to an image of 256 colours: half the file, and a figure hardly has more."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

MOST_COLOURS = 4096
"""Up to so many colours the most frequent are kept as they are; an image of more is left to Pillow."""


FREQUENT = 208
"""Colours that are kept for being frequent; the rest of the 256 for being unlike all others."""


def reduced(pixels: NDArray[np.uint8]) -> Image.Image:
    """An image of at most 256 colours.

    The most frequent colours stay what they are, and so do those unlike any of these, rare as they may be;
    each of the others, the steps of smoothed edges, becomes the nearest one. For figures this is more exact
    than a median cut, and several times as fast.

    Parameters
    ----------
    pixels : ndarray of uint8, shape (height, width, 3)

    Returns
    -------
    PIL.Image.Image
        With a palette.
    """
    height, width, _ = pixels.shape
    red, green, blue = (pixels[..., i].ravel() for i in range(3))
    codes = (red.astype(np.int32) << 16) | (green.astype(np.int32) << 8) | blue
    present = np.zeros(1 << 24, bool)
    present[codes] = True
    colours = np.flatnonzero(present).astype(np.int32)
    if len(colours) > MOST_COLOURS:
        whole = Image.fromarray(np.ascontiguousarray(pixels))
        return whole.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    place = np.empty(1 << 24, np.uint16)
    place[colours] = np.arange(len(colours), dtype=np.uint16)
    of_pixel = place[codes]
    often = np.bincount(of_pixel, minlength=len(colours))
    split = np.stack([colours >> 16, colours >> 8 & 255, colours & 255], axis=1)
    kept, nearest = _choose(split, np.argsort(-often, kind="stable"))
    image = Image.frombytes("P", (width, height), nearest[of_pixel].tobytes())
    image.putpalette(split[kept].astype(np.uint8).tobytes())
    return image


def _choose(colours: NDArray[np.int32], by_count: NDArray[np.intp]) -> tuple[list[int], NDArray[np.uint8]]:
    """The colours (n, 3) that are kept, and which of these each becomes."""
    kept = [int(i) for i in by_count[: FREQUENT if len(colours) > 256 else 256]]
    apart = np.full(len(colours), np.iinfo(np.int32).max)
    nearest = np.zeros(len(colours), np.uint8)
    at = 0
    while True:
        while at < len(kept):
            distance = ((colours - colours[kept[at]]) ** 2).sum(axis=1)
            nearer = distance < apart
            nearest[nearer] = at
            apart[nearer] = distance[nearer]
            at += 1
        if len(kept) == min(256, len(colours)):
            return kept, nearest
        kept.append(int(apart.argmax()))
