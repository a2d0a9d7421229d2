"""The journal: what was stored is found, what was altered is not, and only one study writes."""

from __future__ import annotations

import json

import pytest

from rsibr.errors import BakeError
from rsibr.studies.journal import Journal, lock_study

KEY = {"kind": "point", "samples": 4}


@pytest.fixture
def journal(tmp_path):
    return Journal(tmp_path / "journal")


def test_what_is_stored_is_found_by_an_equal_key_alone(journal):
    assert journal.find(KEY) is None
    journal.store(KEY, {"error": 0.1, "seconds": [1, 2.5]})
    assert journal.find(dict(reversed(KEY.items()))) == {"error": 0.1, "seconds": [1, 2.5]}
    assert journal.find({**KEY, "samples": 5}) is None
    assert journal.find({**KEY, "kind": "bake"}) is None


def test_an_altered_or_truncated_file_is_no_result(journal, tmp_path):
    journal.store(KEY, {"error": 0.1})
    (path,) = (tmp_path / "journal").iterdir()
    whole = path.read_text()
    for text in (whole.replace("0.1", "0.2"), whole[: len(whole) // 2], "", "[]", json.dumps({"result": 1})):
        assert text != whole
        path.write_text(text)
        assert journal.find(KEY) is None
    journal.store(KEY, {"error": 0.3})
    assert journal.find(KEY) == {"error": 0.3}


def test_nan_is_never_stored(journal, tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        journal.store(KEY, {"error": float("nan")})
    assert list((tmp_path / "journal").iterdir()) == []


def test_what_a_killed_process_left_half_written_is_swept(tmp_path):
    left = tmp_path / "journal" / ".point-1.json.00ff.rsibr-tmp"
    left.parent.mkdir()
    left.write_text("{")
    Journal(tmp_path / "journal")
    assert not left.exists()


def test_a_second_study_in_the_same_directory_is_refused(tmp_path):
    with lock_study(tmp_path / "made" / "here"), pytest.raises(BakeError, match="another study"):
        lock_study(tmp_path / "made" / "here")
    with lock_study(tmp_path / "made" / "here"):
        pass


def test_a_file_in_the_way_is_an_error_of_the_user(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(BakeError, match="cannot be written"):
        lock_study(tmp_path / "file" / "study")
