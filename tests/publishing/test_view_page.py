"""The exported page in a real browser: alone on the disk, by keyboard, wipe, tone curves, errors, lost contexts."""

import numpy as np
import pytest
from matplotlib import colormaps

from rsibr.methods.reconstruction import reconstruct
from rsibr.publishing.page import view
from rsibr.store.noise import COVERED, denominator
from rsibr.store.png_file import tone_mapped
from rsibr.validation.report.pictures import RELATIVE_ERROR
from rsibr.validation.report.references import read_references
from rsibr.validation.validation import validate
from tests.publishing.viewer_page import viewer_page

REOPENED = """
async () => {
  const isOpen = () => Boolean(rsibr.viewer.stage && !rsibr.viewer.stage.gl.isContextLost());
  for (let k = 0; k < 100 && !isOpen(); k++) await new Promise((next) => setTimeout(next, 50));
  return isOpen();
}
"""
"""Wait for a context, at most five seconds; the page's own policy forbids what Playwright's waiting would need."""

TWO_FRAMES = "async () => { for (let k = 0; k < 2; k++) await new Promise((next) => requestAnimationFrame(next)); }"

HELD = """
const held = new Promise((go) => { globalThis.release = go; });
globalThis.rsibr = {};
let Engine = null;
Object.defineProperty(rsibr, "Engine", {
  get: () => Engine,
  set(given) {
    const { prepare } = given.prototype;
    given.prototype.prepare = async function (method, progress) {
      progress(0);
      await held;
      return prepare.call(this, method, progress);
    };
    Engine = given;
  },
});
"""
"""Preparations wait for `release()`."""

METHODS = ("nearest", "blend", "cabral1999")


@pytest.fixture(scope="module")
def report(baked, tmp_path_factory):
    """Directory of a validation."""
    out = tmp_path_factory.mktemp("report")
    validate(baked("rough-aluminium"), views=[(1, 2, 3), (0, 1, 0.2)], methods=["cabral1999"], samples=64, out=out)
    return out


@pytest.fixture(scope="module")
def exported(baked, tmp_path_factory):
    """File of a sphere's page."""
    page = view(baked("rough-aluminium"), methods=METHODS)
    return page.write(tmp_path_factory.mktemp("exported") / "page.html")


@pytest.fixture(scope="module")
def with_references(baked, report, tmp_path_factory):
    """File of a sphere's page with the references of a validation."""
    page = view(baked("rough-aluminium"), methods=METHODS, reference=report)
    return page.write(tmp_path_factory.mktemp("judged") / "page.html")


@pytest.fixture(scope="module")
def opened(browser, exported):
    with viewer_page(browser, exported, 640, 480) as page:
        yield page


@pytest.fixture
def fresh(browser, exported):
    """A page of its own, for tests that take its context away."""
    with viewer_page(browser, exported, 640, 480) as page:
        page.home()
        yield page


@pytest.fixture
def judged(browser, with_references):
    """A page with references."""
    with viewer_page(browser, with_references, 640, 480) as page:
        page.home()
        yield page


@pytest.fixture
def page(opened):
    """The page at its first view."""
    opened.home()
    return opened


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 420])
def test_it_fits_its_window_and_asks_for_nothing(browser, with_references, width):
    with viewer_page(browser, with_references, width, 800) as page:
        assert page.ask("() => document.documentElement.scrollWidth <= innerWidth")
        picture = page.pixels()
        assert 0.3 < (picture[..., 3] == 255).mean() < 0.9  # the sphere, before nothing
        assert page.page.locator("#message").is_hidden()


def test_every_control_has_a_name(page):
    page.set(against="blend")
    session = page.page.context.new_cdp_session(page.page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    roles = {"combobox", "slider", "button", "checkbox", "application", "img", "DisclosureTriangle", "group"}
    named = [(one["role"]["value"], one["name"]["value"]) for one in nodes if one.get("role", {}).get("value") in roles]
    assert len(named) > 15
    assert [role for role, name in named if not name and role != "group"] == []
    wanted = {"Method", "Compare with", "Lookup", "Exposure", "Tone curve", "Wipe between two methods"}
    assert wanted <= {name for _, name in named}


def test_keys_orbit_and_lead_home(page):
    first, told = page.pixels(), page.page.inner_text("#view")
    page.page.focus("#picture")
    page.page.keyboard.press("ArrowRight")
    turned = page.pixels()
    assert np.abs(turned - first).max() > 8
    assert page.page.inner_text("#view") != told
    page.page.keyboard.press("Home")
    assert np.array_equal(page.pixels(), first)
    page.page.keyboard.press("+")
    assert (page.pixels()[..., 3] > 0).sum() > 1.2 * (first[..., 3] > 0).sum()


def test_the_first_frame_of_a_choice_is_told_as_such(page):
    page.set(method="blend", lookup="map-normal")
    page.page.wait_for_selector("text=ms for the first frame")
    page.ask("() => rsibr.viewer.orbit(0.1, 0)")
    page.page.wait_for_selector("text=ms a frame")


def test_dragging_turns_the_sphere_with_the_pointer(page):
    before = page.ask("() => rsibr.viewer.camera.azimuth")
    page.page.mouse.move(150, 150)
    page.page.mouse.down()
    page.page.mouse.move(250, 150)
    page.page.mouse.up()
    assert page.ask("() => rsibr.viewer.camera.azimuth") - before == pytest.approx(-np.pi / 4)


def test_the_wipe_shows_one_method_on_each_side(page):
    left = page.pixels()
    page.set(method="nearest")
    right = page.pixels()
    page.set(method="cabral1999", against="nearest")
    page.page.focus("#wipe")
    page.page.keyboard.press("ArrowLeft")
    both = page.pixels()
    edge = round(0.49 * both.shape[1])
    assert np.array_equal(both[:, :edge], left[:, :edge])
    assert np.array_equal(both[:, edge:], right[:, edge:])
    assert np.abs(left - right).max() > 20
    assert page.page.get_attribute("#wipe", "aria-valuenow") == "49"


def test_the_view_of_a_sphere_is_its_map(page, baked):
    """In the parallel projection each pixel is a point of the library's map, and each lookup takes the same."""
    view = page.ask("() => rsibr.viewer.camera.view")
    exposure = page.ask("() => rsibr.viewer.page.exposure")
    made = reconstruct(baked("rough-aluminium"), view, method="cabral1999", resolution=128)
    expected = tone_mapped(made.image, made.coverage, exposure).astype(int)
    found = {}
    for lookup in ("map-reflection", "map-normal", "pixel"):
        page.set(lookup=lookup)
        picture = found[lookup] = page.pixels()
        height, width = picture.shape[:2]
        radius = min(width, height) / 2 / 1.06
        offset = (np.arange(24, 104, 8) + 0.5) / 64 - 1
        rows = np.rint(height / 2 + radius * offset - 0.5).astype(int)
        columns = np.rint(width / 2 + radius * offset - 0.5).astype(int)
        seen = picture[np.ix_(rows, columns)][..., :3]
        assert np.abs(seen - expected[24:104:8, 24:104:8, :3]).mean() < 2.5, lookup
    assert np.abs(found["map-reflection"] - found["map-normal"]).mean() < 0.5


@pytest.mark.slow
def test_tone_curves_are_their_formulae(judged, report):
    """On the reference, whose texels are known."""
    stored = read_references(report).maps[0]
    exposure = judged.ask("() => rsibr.viewer.page.exposure")
    found = {}
    for tone in ("linear", "filmic", "luminance"):
        judged.set(show="reference", reference=0, tone=tone)
        picture = judged.pixels()  # the scale of the luminance takes some of its height
        texel, seen = middle_texel(picture, len(stored.coverage))
        found[tone] = picture[seen][:3]
    light = stored.radiance[texel].astype(float)
    x = light * exposure
    filmic = np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0, 1)
    assert np.abs(found["linear"] - srgb(np.minimum(x, 1))).max() <= 1.5
    assert np.abs(found["filmic"] - srgb(filmic)).max() <= 1.5
    stops = np.log2(x @ [0.2126, 0.7152, 0.0722])
    expected = 255 * np.array(colormaps["viridis"]((stops + 8) / 12))[:3]
    assert np.abs(found["luminance"] - expected).max() < 6
    assert judged.page.locator("#scale").is_visible()


@pytest.mark.slow
def test_errors_are_those_of_the_library(judged, baked, report):
    references = read_references(report)
    for number, stored in enumerate(references.maps):
        judged.set(show="error", reference=number)
        (found,) = judged.ask("() => rsibr.viewer.errors().map((e) => ({...e, errors: Array.from(e.errors, String)}))")
        made = reconstruct(baked("rough-aluminium"), stored.view, method="cabral1999")
        inside = stored.coverage >= COVERED
        truth = stored.radiance[inside].astype(float)
        squared = ((made.image[inside] - truth) ** 2 / denominator(truth)).mean(axis=1)
        assert found["relMse"] == pytest.approx(squared.mean(), rel=0.02)
        errors = np.array(found["errors"], float).reshape(inside.shape)
        assert np.array_equal(np.isfinite(errors), inside)
        assert np.median(np.abs(errors[inside] / np.sqrt(squared) - 1)) < 0.02
        picture = judged.pixels()
        texel, seen = middle_texel(picture, len(inside))
        expected = 255 * np.array(colormaps["magma"](float(RELATIVE_ERROR.position(errors[texel]))))[:3]
        assert np.abs(picture[seen][:3] - expected).max() < 8
    assert "relMSE" in judged.page.inner_text("#errors")


def test_a_click_on_the_sphere_of_views_goes_to_a_stored_view(page):
    box = page.page.locator("#views").bounding_box()
    assert box is not None
    page.page.locator("#views").click(position={"x": box["width"] / 2, "y": box["height"] / 2})
    view = np.array(page.ask("() => rsibr.viewer.camera.view"))
    stored = np.array(page.ask("() => Array.from(rsibr.viewer.stage.engines[0].views)")).reshape(-1, 3)
    assert np.abs(stored - view).max(axis=1).min() < 1e-5
    page.ask(TWO_FRAMES)  # the click may have scrolled the picture out of sight
    assert page.page.input_value("#stored") != ""


@pytest.mark.slow
def test_a_lost_context_is_made_anew(fresh):
    first = fresh.pixels()
    fresh.ask("() => rsibr.viewer.stage.gl.getExtension('WEBGL_lose_context').loseContext()")
    assert fresh.ask(REOPENED)
    assert np.array_equal(fresh.pixels(), first)


@pytest.mark.slow
def test_a_picture_out_of_sight_gives_its_context_back_and_stays(fresh):
    first = fresh.pixels()
    fresh.ask("() => rsibr.viewer.release()")
    assert fresh.page.locator("#still").is_visible()
    assert fresh.ask("() => rsibr.viewer.stage === null")
    fresh.ask("() => rsibr.viewer.reopen()")
    assert np.array_equal(fresh.pixels(), first)


@pytest.mark.slow
def test_out_of_sight_the_panel_goes_on_and_waiting_ends(fresh):
    """On a low window the panel scrolls the picture away, which then gives its context back."""
    first = fresh.pixels()
    fresh.scroll("#stored-views")
    assert not fresh.ask("() => rsibr.viewer.visible")
    with pytest.raises(Exception, match="out of sight"):
        fresh.ask("() => rsibr.viewer.settled()")
    fresh.ask("() => rsibr.viewer.stage.gl.getExtension('WEBGL_lose_context').loseContext()")
    fresh.page.select_option("#stored", "5")
    fresh.ask(TWO_FRAMES)
    assert fresh.page.inner_text("#triangle") == "view 5: 100 %"
    assert fresh.page.input_value("#stored") == "5"
    fresh.scroll("#frame")
    moved = fresh.pixels()
    assert np.abs(moved - first).max() > 8
    fresh.home()
    assert np.array_equal(fresh.pixels(), first)


@pytest.mark.slow
def test_a_context_that_cannot_be_had_ends_waiting_and_is_asked_for_by_a_button(fresh):
    first = fresh.pixels()
    fresh.ask("() => { HTMLCanvasElement.prototype.own = HTMLCanvasElement.prototype.getContext; }")
    fresh.ask("() => { HTMLCanvasElement.prototype.getContext = () => null; rsibr.viewer.release(); }")
    fresh.ask("() => rsibr.viewer.reopen()")
    with pytest.raises(Exception, match="no graphics context"):
        fresh.ask("() => rsibr.viewer.settled()")
    fresh.ask("() => { HTMLCanvasElement.prototype.getContext = HTMLCanvasElement.prototype.own; }")
    fresh.page.click("text=Try again")
    assert np.array_equal(fresh.pixels(), first)


@pytest.mark.slow
def test_another_method_stands_in_until_one_is_prepared(browser, baked, tmp_path):
    file = view(baked("rough-aluminium")).write(tmp_path / "page.html")
    with viewer_page(browser, file, 640, 480, before=HELD, starts=False) as page:
        page.ask("async () => { await rsibr.ready; }")
        page.page.wait_for_selector("text=Preparing rsibr")
        assert "cabral1999 is shown" in page.page.inner_text("#message")
        assert page.page.locator("#still").is_hidden()
        early = page.ask("() => rsibr.viewer.stage.engines[0].methods.filter((one) => rsibr.viewer.stage.isReady(one))")
        assert early == ["nearest", "blend", "cabral1999"]
        page.ask("() => release()")
        page.pixels()
        assert page.page.locator("#message").is_hidden()


@pytest.mark.slow
def test_without_webgl2_there_is_a_still_picture_and_a_reason(browser, exported):
    nothing = "HTMLCanvasElement.prototype.getContext = () => null"
    with viewer_page(browser, exported, before=nothing, starts=False) as page:
        page.page.wait_for_selector("text=no WebGL2")
        assert page.ask("() => document.getElementById('still').naturalWidth") > 16
        assert page.page.locator("#method").is_disabled()


@pytest.mark.slow
def test_more_than_a_gpu_may_hold_is_said_before(browser, exported):
    small = "globalThis.rsibr = {}; Object.defineProperty(rsibr, 'safeMemory', { get: () => 1e5, set() {} })"
    with viewer_page(browser, exported, 640, 480, before=small, starts=False) as page:
        page.page.wait_for_selector("text=graphics memory")
        assert page.ask("() => rsibr.viewer.stage === null")
        page.page.click("text=Load it all the same")
        page.ask("async () => { await rsibr.ready; }")
        assert page.pixels()[..., 3].any()


@pytest.mark.slow
def test_eighteen_pages_in_a_notebook_show_what_is_in_sight(browser, baked, tmp_path):
    """A browser keeps 16 contexts, and takes the first at the seventeenth."""
    made = view(baked("rough-aluminium"), methods=["nearest"], height=400)
    file = tmp_path / "notebook.html"
    file.write_text(f"<!doctype html><meta charset=utf-8>{made._repr_html_() * 18}", encoding="utf-8")
    context = browser.new_context(viewport={"width": 800, "height": 450}, reduced_motion="reduce")
    try:
        page = context.new_page()
        page.goto(file.as_uri())
        frames = "() => [...document.querySelectorAll('iframe')].map((one) => one.contentWindow.rsibr?.viewer?.stage)"
        for k in range(18):
            page.evaluate("(k) => document.querySelectorAll('iframe')[k].scrollIntoView()", k)
            page.wait_for_function(f"(k) => {{ const all = ({frames})(); return !!all[k]; }}", arg=k)
        page.wait_for_timeout(2500)  # RELEASE_AFTER
        stages = page.evaluate(f"() => ({frames})().map((one) => !!one)")
        assert stages[17]
        assert sum(stages) <= 3
    finally:
        context.close()


def middle_texel(picture, size):
    """Texel near the middle of a map of `size`, and a pixel inside it."""
    height, width = picture.shape[:2]
    radius, texel = min(width, height) / 2 / 1.06, size // 2
    offset = (texel + 0.5) / size * 2 - 1
    pixel = int(height / 2 + radius * offset), int(width / 2 + radius * offset)
    return (texel, texel), pixel


def srgb(x):
    return 255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
