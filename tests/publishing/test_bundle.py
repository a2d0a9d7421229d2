"""Bundles: how arrays are encoded, what is refused, and what a page's script tag holds."""

import gzip
import json
import re

import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.publishing.bundle import bundle_of, engine_script
from rsibr.publishing.bundle.bundle import Bundle
from rsibr.publishing.bundle.encoding import LARGEST_HALF, encoded, encoded_images, predicted, rounded
from rsibr.publishing.bundle.tables.light import reduced
from rsibr.publishing.bundle.tables.stored_views import filling


def test_half_images_hold_a_sun(rng):
    """Radiance beyond the range of half numbers is scaled by a power of two."""
    sky = rng.random((8, 8, 3)).astype(np.float32)
    sky[3, 4] = 1e6
    kept = encoded_images(sky, "half")
    assert (kept.type, kept.shape, kept.is_image) == ("half", (3, 8, 8), True)
    assert 1e6 / LARGEST_HALF <= kept.scale <= 2e6 / LARGEST_HALF
    assert encoded_images(sky * 1e-3, "half").scale == 1.0
    assert encoded_images(sky, "float").scale == 1.0


def test_bytes_of_equal_significance_stand_together():
    numbers = np.array([0x0102, 0x0304], np.int16)
    assert gzip.decompress(encoded(numbers).data) == bytes([2, 4, 1, 3])


@pytest.mark.parametrize("mantissa", [10, 7, 5])
def test_rounding_errs_by_half_a_step_and_is_unbiased(mantissa, rng):
    numbers = rng.uniform(1, 2, 20000).astype(np.float16)
    found = rounded(numbers, mantissa).astype(np.float64) - numbers
    assert np.abs(found).max() <= 2.0 ** -(mantissa + 1)
    assert abs(found.mean()) < 4 * 2.0**-mantissa / np.sqrt(12 * len(numbers))  # false alarms: 6e-5
    largest = np.array([LARGEST_HALF, -LARGEST_HALF], np.float16)
    assert np.isfinite(rounded(largest, mantissa)).all()


def test_nothing_is_left_of_a_constant_grey_image():
    """But for the first number of its green channel."""
    left = predicted(np.full((2, 3, 5, 4), 77, np.uint16))
    assert (left != 0).sum() == 2
    assert (left[:, 1, 0, 0] == 154).all()  # the sign is the lowest bit


def test_every_texel_beyond_the_disk_is_filled_from_the_nearest_inside():
    offsets = filling(16)
    rows, columns = np.indices((18, 18)) + offsets
    y, x = (rows - 0.5 - 8) / 8, (columns - 0.5 - 8) / 8
    assert (np.hypot(x, y) < 1 + np.sqrt(0.5) / 8).all()
    assert (offsets[:, 9, 9] == 0).all()
    assert offsets[:, 0, 9].tolist() == [1, 0]


def test_light_is_reduced_to_means():
    picture = np.arange(4 * 4 * 3, dtype=np.float32).reshape(4, 4, 3)
    assert np.array_equal(reduced(picture, 2)[0, 0], picture[:2, :2].mean(axis=(0, 1)))
    with pytest.raises(InputError, match="light_size"):
        reduced(picture, 3)


def test_a_script_tag_cannot_be_left():
    tag = Bundle({"name": "</script><b>"}, {}).to_script("own")
    assert tag.startswith('<script type="application/json" id="own">')
    assert tag.count("<") == 2
    assert json.loads(re.sub(r"<.*?>", "", tag))["name"] == "</script><b>"


def test_what_a_page_cannot_draw_is_refused(baked):
    bake = baked("rough-aluminium")
    for methods, message in (
        (["rsibr-fine"], "cannot draw 'rsibr-fine'.*there are"),
        (["cabral199"], "Did you mean 'cabral1999'"),
    ):
        with pytest.raises(InputError, match=message):
            bundle_of(bake, methods=methods)
    with pytest.raises(InputError, match="16 to 2048"):
        bundle_of(bake, methods=["nearest"], sizes=(8,))


def test_a_bundle_is_the_same_each_time_and_holds_what_its_methods_read(baked):
    bake = baked("rough-aluminium")
    one, again = (bundle_of(bake, methods=["nearest"], sizes=(64,), light_size=32) for _ in range(2))
    assert one.to_script() == again.to_script()
    assert one.size == len(one.to_script())
    assert (one.meta["methods"], one.meta["sizes"], one.meta["default"]) == (["nearest"], [32, 64], "nearest")
    assert not [name for name in one.arrays if name.startswith("model.")]
    assert one.arrays["light.picture"].shape == (3, 32, 32)


def test_the_engine_s_script_loads_nothing():
    """No module, no address: the page works from the disk."""
    script = engine_script()
    assert not re.search(r"https?://|\bimport\b|\bfetch\(|</", script)
