"""Progress and notes of calls from Python: bars in notebooks and terminals, nothing in scripts."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from types import SimpleNamespace

import pytest

import rsibr
from rsibr.errors import InputError
from rsibr.progress import BAKE, Job, Progress, as_progress
from rsibr.publishing.progress import notebook
from rsibr.publishing.progress.bars import ProgressBars
from rsibr.shown_progress import shows_progress

NOTE = "a note on <this>"


@shows_progress(Job("count", "things"))
def count(total, on_progress=None):
    for done in range(total + 1):
        (on_progress or (lambda *_: None))(done, total)
    return SimpleNamespace(notes=(NOTE,))


@shows_progress(BAKE)
def outer(on_progress=lambda _: None):
    on_progress(Progress(0, 2, "view 1"))
    count(3)
    on_progress(Progress(1, 2, "view 2", 0.5))


class Handle:
    """Output of a cell that is updated in place."""

    def __init__(self, states):
        self.states = states

    def update(self, data, *, raw):
        assert raw
        self.states.append(data)


@pytest.fixture
def cell(monkeypatch):
    """Outputs of a cell, each as the list of its states; rsibr believes to run in a kernel."""
    outputs = []

    def display(data, *, raw, display_id=False):
        assert raw
        outputs.append([data])
        return Handle(outputs[-1]) if display_id else None

    monkeypatch.setattr(notebook, "PERIOD", 0.0)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object())))
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))
    return outputs


@pytest.fixture(autouse=True)
def _as_at_first():
    yield
    rsibr.show_progress()


def test_a_notebook_shows_bars_in_one_output_which_is_empty_at_the_end_and_the_notes_in_another(cell):
    count(4)
    bars, notes = cell
    texts = [state["text/plain"] for state in bars]
    assert texts[0] == "count: preparing"
    assert [re.search(r"\d/4", text).group() for text in texts[1:-1]] == [f"{done}/4" for done in range(5)]
    assert texts[-1] == ""
    assert all(notebook.MARK in state["text/html"] for state in bars)  # by which a stored notebook drops it
    assert re.sub("<[^>]*>", "", bars[-1]["text/html"]) == ""
    assert notes == [{"text/plain": f"note: {NOTE}", "text/html": notes[0]["text/html"]}]
    assert "a note on &lt;this&gt;" in notes[0]["text/html"]


def test_a_call_within_a_call_shows_nothing_of_its_own(cell):
    outer()
    (bars,) = cell
    assert "view 2" in bars[-2]["text/plain"]
    assert " 8/16" in bars[-2]["text/plain"]
    assert not any("count" in state["text/plain"] for state in bars)


def test_the_callback_of_the_user_is_called_and_nothing_is_shown(cell):
    seen = []
    count(2, on_progress=lambda *state: seen.append(state))
    assert seen == [(0, 2), (1, 2), (2, 2)]
    assert cell == []


def test_the_callback_of_the_user_silences_calls_within(cell):
    outer(on_progress=lambda _: None)
    assert cell == []


def test_bars_go_when_the_job_fails(cell):
    @shows_progress(Job("fail"))
    def fail(on_progress=None):
        raise RuntimeError("so it does")

    with pytest.raises(RuntimeError, match="so it does"):
        fail()
    assert cell[0][-1]["text/plain"] == ""
    count(1)
    assert len(cell) == 3  # the one that failed, bars, notes


def test_no_progress_no_notes_of_what_was_there_already(cell):
    @shows_progress(Job("open"))
    def already_there(on_progress=None):
        return SimpleNamespace(notes=(NOTE,))

    already_there()
    assert len(cell) == 1


def test_show_progress_turns_a_notebook_silent(cell):
    rsibr.show_progress(False)
    count(2)
    assert cell == []


@pytest.mark.parametrize("wrong", ["on", None, 2])
def test_show_progress_takes_nothing_else(wrong):
    with pytest.raises(InputError, match="show_progress"):
        rsibr.show_progress(wrong)


def test_a_script_shows_nothing_of_its_own_accord(capfd):
    count(2)
    assert capfd.readouterr() == ("", "")


def test_a_script_shows_lines_on_stderr_when_asked_for(capfd):
    rsibr.show_progress(True)
    count(2)
    out, err = capfd.readouterr()
    assert out == ""
    preparing, first, *_, last = err.splitlines()
    assert preparing == "count: preparing"
    assert first.startswith("count: 0 of 2 things (0%)")
    assert last == f"note: {NOTE}"


def test_a_terminal_has_bars_that_go(monkeypatch):
    from rich.console import Console

    stream = io.StringIO()
    bars = ProgressBars(BAKE, Console(file=stream, force_terminal=True, width=80))
    with bars.bars:
        bars.show(Progress(3, 12, "view 4", 0.25))
    assert " 3/12" in stream.getvalue()
    assert " 4/16" in stream.getvalue()
    assert stream.getvalue().endswith("\x1b[2K")  # the lines of the bars are erased


def test_the_arguments_of_every_callback_are_a_state():
    assert as_progress(Progress(1, 2, "here")) == Progress(1, 2, "here")
    assert as_progress(1, 2) == Progress(1, 2, "")


def test_import_loads_nothing_that_draws():
    code = """if True:
        import sys, rsibr
        rsibr.show_progress(True)
        print([name for name in ("rich", "mitsuba", "IPython") if name in sys.modules])
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


PUBLIC = ("bake", "compare", "publish", "render", "render_sequence", "study", "validate", "validate_object")


@pytest.mark.parametrize("name", PUBLIC)
def test_public_functions_show_their_progress(name, cell):
    """An argument that none of them takes: the display is there before, and gone after."""
    with pytest.raises(TypeError):
        getattr(rsibr, name)(no_such_argument=1)
    assert [state["text/plain"] for state in cell[0]][-1] == ""


def test_ipython_in_a_log_shows_lines(monkeypatch, capfd):
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=object))  # a shell, but no kernel
    count(2)
    assert capfd.readouterr().err.startswith("count: preparing\n")
