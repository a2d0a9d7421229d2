"""Maps of the page against the library's, pixel by pixel, in a real browser, under a sky without symmetry."""

import numpy as np
import pytest

from rsibr.geometry.frame import unit_view, view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.methods.rsibr import rsibr
from rsibr.methods.rsibr.belief import Belief
from rsibr.publishing.bundle import bundle_of
from rsibr.publishing.page import write_page
from tests.publishing.engine_page import engine_page, opened, relative_error

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
    """Three views, poles included, of both methods at two sizes: float data, and the file that is exported."""
    bake = baked(material, 160, 16)
    methods, names, sizes = MethodSet(bake), ("cabral1999", "rsibr"), (160, 512)
    with engine_page(browser, bundle_of(bake, precision="float", sizes=sizes), tmp_path) as page:
        assert_equal_maps(page, methods, names, sizes, lambda name: BOUNDS["float", name])
    with opened(browser, write_page(bake, tmp_path / "page.html")) as page:
        assert_equal_maps(page, methods, names, sizes, lambda _: 1e-6)


SYSTEMS = "miller1984", "kautz2003", "split-sum"


@pytest.mark.slow
def test_maps_of_other_systems_equal_the_library_s(browser, baked, tmp_path):
    """Their own tables, of a material with a matte and a glossy lobe."""
    bake = baked("glossy-plastic", 48, 64)
    bundle = bundle_of(bake, precision="float", methods=SYSTEMS, sizes=(48,))
    with engine_page(browser, bundle, tmp_path) as page:
        assert_equal_maps(page, MethodSet(bake), SYSTEMS, (48,), lambda name: 1e-11)


@pytest.mark.slow
def test_maps_of_many_views_equal_the_library_s(browser, baked, tmp_path):
    """The triangle around each view is found among 320."""
    bake = baked("rough-aluminium", 16, 4, subdivision=2)
    names = "nearest", "cabral1999"
    bundle = bundle_of(bake, precision="float", methods=names, sizes=(24,), light_size=32)
    with engine_page(browser, bundle, tmp_path) as page:
        assert page.ask("() => engine.views.length") == 3 * 162
        assert_equal_maps(page, MethodSet(bake), names, (24,), lambda name: 1e-7)


LAMP = 'emitter = {type = "directional", direction = [-0.3, -0.8, -0.5], irradiance = 3.0}'
GLAZE = 'bsdf = {type = "plastic", diffuse_reflectance = {type = "rgb", value = [0.5, 0.1, 0.05]}}'
HARD = {
    "a light without extent": ({"light": LAMP, "material": "glossy-plastic"}, ("rsibr", "split-sum")),
    "a delta lobe over a matte one": ({"surface": GLAZE, "material": "glaze"}, ("rsibr", "cabral1999")),
    "a delta lobe alone": ({"material": "mirror-silver"}, ("rsibr",)),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", HARD)
def test_maps_of_what_no_blur_holds_equal_the_library_s(case, browser, baked, tmp_path):
    options, names = HARD[case]
    bake = baked(resolution=24, samples=16, **options)
    bundle = bundle_of(bake, precision="float", methods=names, sizes=(24,))
    with engine_page(browser, bundle, tmp_path) as page:
        assert_equal_maps(page, MethodSet(bake), names, (24,), lambda name: BOUNDS.get(("float", name), 1e-9))


@pytest.mark.slow
@pytest.mark.parametrize("scaled", [1.0, 0.7])
def test_maps_of_a_model_that_is_not_believed_equal_the_library_s(scaled, browser, baked, tmp_path, monkeypatch):
    """Interpolation mixed in by angle; with lobes scaled down, residuals are neither damped nor bounded."""
    believed = Belief(np.linspace(0.1, 0.9, 6), np.array([scaled, 1.0]), np.linspace(0.2, 0.8, 6))
    monkeypatch.setattr(rsibr, "learnt", lambda *given: believed)
    bake = baked("glossy-plastic", 48, 64)
    methods = MethodSet(bake)
    assert len(methods.inputs.lobes) == 2
    bundle = bundle_of(bake, precision="float", methods=["rsibr"], sizes=(48,))
    assert bundle.meta["model"]["isHedged"]
    with engine_page(browser, bundle, tmp_path) as page:
        assert_equal_maps(page, methods, ["rsibr"], (48,), lambda name: 5e-9)
