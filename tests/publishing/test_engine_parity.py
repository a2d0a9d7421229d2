"""Maps of the page against the library's, pixel by pixel, in a real browser, under a sky without symmetry."""

import pytest

from rsibr.geometry.frame import unit_view, view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.publishing.bundle import bundle_of
from tests.publishing.engine_page import engine_page, relative_error

VIEWS = [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.3, -0.5, 0.8]
MATERIALS = "clearcoat-red", "rough-aluminium", "glossy-plastic"
BOUNDS = {("float", "rsibr"): 5e-9, ("float", "cabral1999"): 1e-7}
"""With half numbers 1e-6; rounding to them alone makes some 5e-8."""

MIRRORED = 1e-2
"""A map that is turned over errs by more."""


def assert_equal_maps(page, methods, names, sizes, bounds):
    for name in names:
        for size in sizes:
            for view in VIEWS:
                frame = view_frame(unit_view(view))
                wanted, found = run(methods[name], frame, size), page.map(name, frame, size)
                error = relative_error(found, wanted.image, wanted.coverage)
                assert error < bounds(name), (name, size, view, error)
                for turned in (found[:, ::-1], found[::-1]):
                    assert relative_error(turned, wanted.image, wanted.coverage) > MIRRORED, (name, size, view)


def test_small_maps_equal_the_library_s(browser, baked, tmp_path):
    """Float data, poles included."""
    bake = baked("rough-aluminium")
    names = ["nearest", "blend", "cabral1999", "rsibr"]
    bundle = bundle_of(bake, precision="float", sizes=(48,))
    assert bundle.meta["methods"] == names
    with engine_page(browser, bundle, tmp_path) as page:
        assert_equal_maps(page, MethodSet(bake), names, (48,), lambda name: BOUNDS.get(("float", name), 1e-7))


@pytest.mark.slow
@pytest.mark.parametrize("material", MATERIALS)
def test_maps_equal_the_library_s(material, browser, baked, tmp_path):
    """Three views, poles included, of `cabral1999` and `rsibr` at two sizes, with half and with float data."""
    bake = baked(material, 48, 64)
    methods, names, sizes = MethodSet(bake), ("cabral1999", "rsibr"), (160, 512)
    for precision in ("float", "half"):
        bundle = bundle_of(bake, precision=precision, sizes=sizes)
        with engine_page(browser, bundle, tmp_path) as page:
            assert_equal_maps(page, methods, names, sizes, lambda name: BOUNDS.get((precision, name), 1e-6))  # noqa: B023
