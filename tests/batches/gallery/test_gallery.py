"""The gallery's page: everything is shown, nothing is taken for HTML, and it stays small."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.batches.gallery import gallery
from rsibr.batches.gallery.entry import GalleryEntry
from rsibr.batches.gallery.gallery import write_gallery
from rsibr.batches.gallery.thumbnail import thumbnail, thumbnail_side
from rsibr.errors import BakeError
from tests.validation.report.test_report import Page

HOSTILE = "\"'><script>window.broken = 1</script><img src=x onerror='window.broken = 1'>&amp;{{ 7 * 7 }}"


def sphere(level, size=32):
    """Radiance of a matte sphere lit from above."""
    y, x = np.mgrid[1 : -1 : size * 1j, -1 : 1 : size * 1j]
    inside = x**2 + y**2 < 1
    return (level * np.where(inside, 0.6 + 0.4 * y, 0))[..., None] * np.array([1.0, 0.6, 0.3])


def entries():
    """4 materials × 3 skies, one of which failed."""
    made = []
    for row, material in enumerate(("red", "silver", "matte", "pearl")):
        for column, (sky, level) in enumerate({"noon": 30.0, "dusk": 0.3, "night": 3e-4}.items()):
            values, number = {"material": material, "sky": sky}, 3 * row + column
            failed = number == 7
            made.append(
                GalleryEntry(
                    f"{material}/{sky}",
                    values,
                    None if failed else sphere(level * (1 + row)),
                    None if failed else 1e-4 * (number * 5 % 12) - 1e-4,
                    2.0 + number,
                    None if failed else 10_000 * (12 - number),
                    None if failed else f"reports/{material}/{sky}/report.html",
                    "SIGSEGV (signal 11) at view 3" if failed else None,
                )
            )
    return made


def read(path):
    page = Page()
    page.feed(path.read_text(encoding="utf-8"))
    assert page.open == []
    return page


def test_every_job_is_shown_with_its_numbers_and_its_report(tmp_path):
    page = read(write_gallery(tmp_path, entries(), "zoo"))
    text = " ".join(page.text.replace("\xa0", " ").split())
    assert page.tags.count("img") == 11
    assert page.tags.count("figure") == 12
    for told in (
        "12 jobs: 11 done, 1 failed",
        "relMSE 9.0 × 10⁻⁴",
        "13.0 s",
        "117 KiB",
        "below the noise floor",
        "material \\ sky",
    ):
        assert told in text
    assert text.count("SIGSEGV (signal 11) at view 3") == 2  # in the list above, and in its place
    links = {reference for reference in page.references if not reference.startswith("data:image/webp;base64,")}
    assert links == {"#failed"} | {entry.link for entry in entries() if entry.link}
    assert "white is a radiance of" in text


def test_no_name_or_reason_is_taken_for_html(tmp_path):
    values = {HOSTILE: HOSTILE, "sky": HOSTILE, "third": HOSTILE}
    jobs = [
        GalleryEntry(HOSTILE, values, sphere(1), 0.1, 1.0, 1, report="javascript:window.broken = 1"),
        GalleryEntry(HOSTILE + "2", values, None, None, None, None, None, reason=HOSTILE),
    ]
    path = write_gallery(tmp_path, jobs, HOSTILE)
    page = read(path)
    assert page.tags.count("script") == 1
    assert page.tags.count("img") == 1
    assert page.text.count(HOSTILE) >= 8
    assert {link for link in page.references if "broken" in link} == {"./javascript%3Awindow.broken%20%3D%201"}


def test_many_jobs_stay_small_and_the_page_says_what_it_leaves_out(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "MOST_PICTURES", 300)
    small = sphere(1.0, 96)
    jobs = [GalleryEntry(f"m{n}", {"m": n}, small, 0.1, 1.0, 1) for n in range(900)]
    jobs[899] = GalleryEntry("last", {"m": 899}, reason="lost")
    path = write_gallery(tmp_path, jobs, "many")
    assert path.stat().st_size < 300 * 5000
    page = read(path)
    assert page.tags.count("img") == 299
    text = " ".join(page.text.split())
    assert "shows 300 jobs, failed ones first; all 900" in text
    assert "lost" in text


def test_a_thumbnail_is_the_mean_of_blocks(rng):
    picture = rng.uniform(size=(400, 400, 3))
    small = thumbnail(picture, jobs=300)
    assert small.shape == (80, 80, 3)
    np.testing.assert_allclose(small[3, 4], picture[15:20, 20:25].mean(axis=(0, 1)), rtol=1e-6)
    assert thumbnail(picture[:64, :64], jobs=2000).shape == (64, 64, 3)
    picture[0, 0] = np.nan
    assert np.isfinite(thumbnail(picture)).all()
    assert [thumbnail_side(jobs) for jobs in (1, 201, 601, 10**6)] == [192, 96, 64, 64]


def test_an_empty_batch_has_a_page_too(tmp_path):
    assert "0 jobs" in read(write_gallery(tmp_path, [], "nothing")).text


def test_a_folder_that_is_none_is_an_error_of_the_user(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(BakeError, match="file"):
        write_gallery(tmp_path / "file", entries(), "zoo")


@pytest.fixture
def page(browser, tmp_path):
    path = write_gallery(tmp_path, entries(), HOSTILE)
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    complaints = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(path.as_uri())
    yield page
    assert page.evaluate("window.broken") is None
    page.close()
    assert complaints == []


def test_the_jobs_are_ordered_by_keys_and_go_home_again(page):
    names = "[...document.querySelectorAll('main .job')].filter((j) => j.checkVisibility()).map((j) => j.dataset.name)"
    home = page.evaluate(names)
    assert home == [entry.name for entry in entries()]
    page.get_by_role("button", name="error").focus()
    page.keyboard.press("Enter")
    judged = [entry for entry in entries() if entry.error is not None]
    by_error = [entry.name for entry in sorted(judged, key=lambda entry: -entry.error)]
    assert page.evaluate(names) == [*by_error, "matte/dusk"]  # what has no error stands last
    page.keyboard.press("Space")
    assert page.evaluate(names) == [*by_error[::-1], "matte/dusk"]
    assert page.locator("[aria-live]").text_content() == "ordered by error, smallest first"
    page.get_by_role("button", name="name").click()
    assert page.evaluate(names) == sorted(home)
    page.get_by_role("button", name="matrix").click()
    assert page.evaluate(names) == home
    assert page.locator("[aria-pressed=true]").count() == 1


def test_the_exposure_moves_all_pictures_along_the_curve(page):
    """A stop more on the slider shows a picture as one of twice its radiance is shown, but for 8 bits and WebP."""
    median = """(name) => {
      const canvas = document.querySelector(`.job[data-name="${name}"] canvas.picture`);
      const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
      return [...data].filter((_, i) => i % 4 === 0).sort((a, b) => a - b)[data.length / 8];
    }"""
    slider = page.get_by_role("slider")
    slider.fill("0.5")
    page.wait_for_selector("canvas.picture")
    slider.fill("0")
    page.wait_for_function("document.querySelector('output').textContent === 'as chosen'")
    twice = page.evaluate(median, "silver/dusk")
    slider.fill("1")
    page.wait_for_function("document.querySelector('output').textContent.startsWith('+1 EV')")
    assert page.evaluate(median, "red/dusk") == pytest.approx(twice, abs=3)
    assert slider.get_attribute("aria-valuetext").startswith("+1 EV, white ")


@pytest.mark.parametrize("width", [1280, 420])
def test_nothing_runs_over_the_page(page, width):
    page.set_viewport_size({"width": width, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("[...document.querySelectorAll('.wide')].every((one) => one.scrollWidth <= one.clientWidth)")
