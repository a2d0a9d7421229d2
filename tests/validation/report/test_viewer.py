"""The page of a report in a real browser: wipe, zoom, views, and what is left without a script."""

from __future__ import annotations

import pytest

from rsibr.validation.report.report import write_report
from tests.validation.results_double import small_validation, with_lobes

METHODS = {"nearest", "cabral1999", "perfect"}


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return write_report(with_lobes(small_validation()), tmp_path_factory.mktemp("viewer"))


@pytest.fixture
def opened(browser, report):
    """Open the report in a window; whatever the page complains of fails the test."""
    contexts, complaints = [], []

    def window(width=1280, **options):
        context = browser.new_context(viewport={"width": width, "height": 900}, **options)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None)
        page.on("request", lambda asked: None if asked.url.startswith("file://") else complaints.append(asked.url[:60]))
        page.goto(report.as_uri())
        return page

    yield window
    for context in contexts:
        context.close()
    assert [complaint for complaint in complaints if not complaint.startswith("data:")] == []


def sources(page):
    """Which card each picture of the stage is taken from, and what kind it is."""
    return page.evaluate(
        """() => [...document.querySelectorAll('.stage .pane img')].map((shown) => {
          // maps of two views may be equal to the byte: their errors are not
          const all = [...document.querySelectorAll('.card img')].filter((img) => img.src === shown.src);
          const from = all.find((img) => img.checkVisibility()) ?? all[0];
          return [from.closest('.card').dataset.of, from.dataset.kind, from.closest('section').id];
        })"""
    )


def test_the_stage_shows_the_reference_and_the_best_method_and_changes_by_choice(opened):
    page = opened()
    assert sources(page) == [
        ["reference", "image", "view-1"],
        ["perfect", "image", "view-1"],
        ["perfect", "error", "view-1"],
    ]
    page.select_option("[data-choose=b]", "nearest")
    page.select_option("[data-choose=kind]", "flip")
    page.locator(".index input").first.focus()
    page.keyboard.press("ArrowRight")  # radio buttons: the next view
    assert sources(page) == [
        ["reference", "image", "view-2"],
        ["nearest", "image", "view-2"],
        ["nearest", "flip", "view-2"],
    ]
    assert page.locator("section.view:visible").count() == 1
    page.locator("#view-2 .card", has_text="cabral1999").get_by_role("button").click()
    assert sources(page)[1][0] == "cabral1999"
    assert METHODS | {"reference", "clear coat, α 0.015: rsibr"} <= set(
        page.locator("[data-choose=a] option").all_text_contents()
    )


def test_the_edge_is_wiped_by_keys_and_by_hand(opened):
    page = opened()
    slider = page.get_by_role("slider", name="Edge between")
    slider.focus()
    for _ in range(10):
        page.keyboard.press("ArrowLeft")
    assert slider.input_value() == "40"
    assert "reference left of 40 %" in slider.get_attribute("aria-valuetext")
    box = page.locator(".pane").first.bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 0.5 * box["height"], steps=3)
    page.mouse.up()
    assert slider.input_value() == "80"
    clip = page.locator(".half").nth(1).evaluate("half => getComputedStyle(half).clipPath")
    assert clip.endswith("80%)")  # the right picture begins where the edge is


def test_both_pictures_zoom_together_and_stay_in_their_frame(opened):
    page = opened()
    pane = page.locator(".pane").nth(1)
    pane.focus()
    for key in ("+", "+", "ArrowRight"):
        page.keyboard.press(key)
    assert page.locator(".toolbar output").text_content() == "2.3×"
    frames = page.evaluate(
        """() => [...document.querySelectorAll('.pane')].map((pane) => {
          const [outer, inner] = [pane, pane.querySelector('img')].map((one) => one.getBoundingClientRect());
          return [inner.width / outer.width, (inner.left - outer.left) / outer.width];
        })"""
    )
    assert frames[0] == pytest.approx(frames[1], abs=1e-3)
    assert frames[0] == pytest.approx([2.25, -0.625 - 0.1], abs=5e-3)
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    left = page.evaluate(
        "() => document.querySelector('.pane img').getBoundingClientRect().right"
        " - document.querySelector('.pane').getBoundingClientRect().right"
    )
    assert left == pytest.approx(0, abs=0.5)
    page.keyboard.press("0")
    assert page.locator(".toolbar output").text_content() == "1×"


def test_zoomed_pictures_are_the_whole_ones_beside_the_page(opened):
    page = opened()
    page.get_by_role("button", name="zoom in").click(click_count=2, delay=20)
    page.wait_for_function("document.querySelector('.pane img').src.startsWith('file:')")
    names = page.evaluate("[...document.querySelectorAll('.pane img')].map((img) => img.src.split('/').pop())")
    assert names == ["view_01_reference.png", "view_01_perfect.png", "view_01_perfect_error.png"]


@pytest.mark.parametrize("width", [1280, 420])
def test_every_column_is_in_sight_and_nothing_runs_over(opened, width):
    page = opened(width)
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    cut = page.evaluate(
        """() => [...document.querySelectorAll('.wide')]
          .filter((box) => box.scrollWidth > box.clientWidth).map((box) => box.ariaLabel)"""
    )
    assert cut == []
    # No caption lies under a picture of its own or of another card
    overlaps = page.evaluate(
        """() => {
          const boxes = (what) => [...document.querySelectorAll(`section.view ${what}`)]
            .map((one) => one.getBoundingClientRect()).filter((box) => box.width > 0);
          const apart = (a, b) => a.right <= b.left + 1 || a.bottom <= b.top + 1;
          const meet = (a, b) => !apart(a, b) && !apart(b, a);
          return boxes('figcaption').filter((text) => boxes('.card img').some((img) => meet(text, img))).length;
        }"""
    )
    assert overlaps == 0


def test_without_a_script_all_pictures_are_shown(opened):
    page = opened(java_script_enabled=False)
    assert not page.locator(".stage").is_visible()
    assert page.locator("section.view:visible").count() == 1
    assert page.locator("section.view:visible .card img:visible").count() == 2 + 3 * 3
    page.locator(".index label").nth(1).click()
    assert page.locator("#view-2 .card").first.is_visible()
