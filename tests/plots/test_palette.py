"""256 colours of many: exact where there are no more, and near where there are."""

import numpy as np
import pytest

from rivid.plots.palette import MOST_COLOURS, reduced


def back(image):
    return np.asarray(image.convert("RGB"))


def test_few_colours_stay_what_they_are():
    rng = np.random.default_rng(0)
    colours = rng.integers(0, 256, (200, 3)).astype(np.uint8)
    pixels = colours[rng.integers(0, 200, (40, 60))]
    assert (back(reduced(pixels)) == pixels).all()
    assert (back(reduced(np.full((3, 4, 3), 7, np.uint8))) == 7).all()


@pytest.mark.parametrize("seed", range(3))
def test_each_pixel_becomes_the_nearest_colour_of_the_palette(seed):
    rng = np.random.default_rng(seed)
    colours = rng.integers(0, 256, (900, 3)).astype(np.uint8)
    pixels = colours[np.minimum(rng.geometric(0.01, (50, 80)), 899)]
    image = reduced(pixels)
    palette = np.array(image.getpalette(), int).reshape(-1, 3)
    apart = ((pixels.reshape(-1, 1, 3).astype(int) - palette) ** 2).sum(axis=2)
    got = ((pixels.astype(int) - back(image)) ** 2).sum(axis=2).ravel()
    assert (got == apart.min(axis=1)).all()


def test_a_rare_colour_unlike_all_others_is_kept():
    greys = np.tile(np.arange(256, dtype=np.uint8), (300, 4))
    pixels = np.repeat(greys[..., None], 3, axis=2)
    pixels[:100, ::2, 2] ^= 1  # more colours than the palette holds
    pixels[7, 7] = (213, 94, 0)
    assert back(reduced(pixels))[7, 7].tolist() == [213, 94, 0]
    assert np.abs(back(reduced(pixels)).astype(int) - pixels).max() <= 4


def test_an_image_of_very_many_colours_is_reduced_all_the_same():
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 256, (90, 90, 3)).astype(np.uint8)
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > MOST_COLOURS
    assert reduced(pixels).getcolors(256) is not None
