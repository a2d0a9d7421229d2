"""What notebooks show of bakes, maps and results: tables, plots, cards, and the page in a notebook that was stored."""

import re
import sys
from html.parser import HTMLParser

import pytest

import rsibr
from rsibr.errors import InputError, MachineError
from rsibr.publishing.notebooks.cards import validation_card
from rsibr.publishing.notebooks.plots import plot_validation
from rsibr.studies.analysis import analyse
from rsibr.studies.compare.document import CompareDocument
from rsibr.studies.compare.runner import Comparison
from rsibr.studies.document import JudgeRecord, MachineRecord, StudyDocument
from rsibr.studies.doubling import PATH_TRACING, doubling_of
from rsibr.studies.runner import Study
from tests.studies.compare import doubles as compared
from tests.studies.doubles import converging, scene
from tests.validation.results_double import small_validation

MACHINE = MachineRecord(variant="llvm_ad_rgb", processors=2, system="a machine", packages={})
FRAMES = 10


@pytest.fixture
def study(tmp_path):
    """A study of one scene whose errors and times are known."""
    points = converging(1e-4, 0.1) + converging(1e-2, 0.1, method="cabral1999")
    scenes = [scene(points)]
    judge = JudgeRecord(views=[(0, 0, 1)], resolution=64, reference_samples=4096, repeats=5, frames=FRAMES)
    document = StudyDocument(
        schema=1,
        name="samples & <bias>",
        judge=judge,
        machine=MACHINE,
        expected_seconds=9.0,
        seconds=70.0,
        steps=[],
        scenes=scenes,
        classes=[],
        analyses=[analyse(one, FRAMES) for one in scenes],
        doubling=doubling_of(scenes, FRAMES),
    )
    return Study(document, tmp_path)


def test_validations_are_tables_plots_and_cards(tmp_path, monkeypatch):
    validation = small_validation()
    frame = validation.to_dataframe()
    assert list(frame["method"]) == ["nearest", "cabral1999", "perfect"] * 2
    assert frame["rel_mse"][0] == pytest.approx(validation.views[0].methods["nearest"].error.rel_mse.value)
    validation.to_csv(tmp_path / "errors.csv")
    assert (tmp_path / "errors.csv").read_text() == validation.csv()
    card = validation_card(validation)
    assert "red &lt;paint&gt;" in card
    assert card.count("<img") == 4
    assert len(card) < 80_000
    texts = [text.get_text() for text in plot_validation(validation).axes[0].get_legend().get_texts()]
    assert texts == ["nearest", "cabral1999", "perfect"]
    shown = [axes.get_title().partition("\n")[0] for axes in validation.show(errors=True).axes]
    assert shown == ["reference", "nearest", "cabral1999", "perfect", "", "", "", "", ""]  # a scale at the end
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MachineError, match="pandas is not installed"):
        validation.to_dataframe()


def test_the_plot_of_a_study_holds_each_method_s_errors_over_the_time_of_the_job(study):
    left, right = study.plot().axes
    lines = {line.get_label(): line for line in left.get_lines()}
    assert {PATH_TRACING, "rsibr", "cabral1999"} <= set(lines)
    errors = [point.rel_mse for point in study.points(method="rsibr")]
    jobs = [point.job_seconds(FRAMES) for point in study.points(method="rsibr")]
    assert lines["rsibr"].get_ydata() == pytest.approx(errors)
    assert lines["rsibr"].get_xdata() == pytest.approx(jobs)
    assert f"{FRAMES} pictures" in left.get_xlabel()
    assert right.get_ylabel() == "twice the time divides the error by"


def test_a_study_of_errors_alone_has_no_plot_over_time(study, tmp_path):
    untimed = study.document.model_copy(update={"analyses": [], "doubling": []})
    with pytest.raises(InputError, match="only errors were measured"):
        Study(untimed, tmp_path).plot()


def test_the_card_of_a_study_tells_its_least_error(study):
    card = study._repr_html_().replace("\N{NO-BREAK SPACE}", " ")
    assert "Study samples &amp; &lt;bias&gt;" in card
    assert "1 scene · 8 points · measured in 1 min 10 s" in card
    cells = re.findall(r"<td>(.*?)</td>", card)
    assert len(cells) == 4
    assert cells[1] == "rsibr, 12 views, 64², 1024 samples"
    assert float(cells[2]) == pytest.approx(1e-4 + 0.1 / 1024, rel=0.03)


def test_a_study_is_a_table(study, tmp_path):
    frame = study.to_dataframe()
    known = frame[frame["method"] == "rsibr"]
    assert list(known["samples"]) == [16, 64, 256, 1024]
    assert list(known["rel_mse"]) == pytest.approx([point.rel_mse for point in study.points(method="rsibr")])
    assert frame["once_seconds"].notna().all()
    study.to_csv(tmp_path / "study.csv")
    assert (tmp_path / "study.csv").read_text(encoding="utf-8") == study.csv()


def test_a_comparison_is_a_table(tmp_path):
    systems = [compared.record("rsibr, 12 views", 1e-3, compared.cost()), compared.record("theirs", 2e-3, None)]
    document = CompareDocument(
        schema=1,
        name="two",
        machine=MACHINE,
        reference_samples=4096,
        shown_view=0,
        seconds=1.0,
        systems=["rsibr", "theirs"],
        classes=[],
        scenes=[compared.scene(systems)],
    )
    found = Comparison(document, tmp_path)
    frame = found.to_dataframe()
    assert list(frame["rel_mse"]) == [1e-3, 2e-3]
    assert list(frame["bake_seconds"].isna()) == [False, True]
    found.to_csv(tmp_path / "compare.csv")
    assert (tmp_path / "compare.csv").read_text(encoding="utf-8") == found.csv()


def test_a_bake_shows_itself(baked):
    bake = baked("rough-aluminium")
    assert len(bake.show(most=4).axes) == 4
    assert f"{bake.view_count} views of 32²" in bake._repr_html_()
    made = rsibr.reconstruct(bake, (1, 2, 3), method="cabral1999")
    assert "cabral1999" in made._repr_html_()
    frame = bake.view(methods=["nearest"])._repr_html_()
    assert frame.startswith('<iframe srcdoc="&lt;!doctype html&gt;')
    assert frame.count("<") == 2  # all of the page lies within the attribute


class Frames(HTMLParser):
    """Pages within the frames of a document."""

    def __init__(self, text):
        super().__init__()
        self.pages = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        if tag == "iframe":
            self.pages.append(dict(attributes)["srcdoc"])


@pytest.mark.slow
def test_a_stored_notebook_keeps_its_page(baked, browser, tmp_path):
    """Executed by nbclient, written, read back, and shown by a real browser; converted by nbconvert where that is."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    bake = baked("rough-aluminium")
    code = f"import rsibr\nrsibr.open_bake({str(bake.path)!r}).view(methods=['nearest'])"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    nbformat.write(notebook, tmp_path / "stored.ipynb")
    stored = nbformat.read(tmp_path / "stored.ipynb", as_version=4)
    (shown,) = [one.data for one in stored.cells[0].outputs if one.output_type == "execute_result"]
    assert shown["text/plain"].startswith("Page(")
    text = converted(stored, shown["text/html"])
    assert Frames(text).pages == [bake.view(methods=["nearest"]).html]
    file = tmp_path / "notebook.html"
    file.write_text(text, encoding="utf-8")
    page = browser.new_page(viewport={"width": 900, "height": 700})
    try:
        page.goto(file.as_uri())
        frame = page.frame_locator("iframe")
        frame.locator("#controls:not([disabled])").wait_for()
        assert frame.locator("#method").input_value() == "nearest"
        frame.locator("text=/ms (for the first|a) frame/").wait_for()
    finally:
        page.close()


def converted(notebook, output):
    """The notebook as HTML, or its output alone where nbconvert is not installed."""
    try:
        from nbconvert import HTMLExporter
    except ImportError:
        return f"<!doctype html><meta charset=utf-8>{output}"
    return HTMLExporter().from_notebook_node(notebook)[0]
