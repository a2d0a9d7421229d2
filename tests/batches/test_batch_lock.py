"""One coordinator a directory, or one of each shard; on a network without locks as well."""

from __future__ import annotations

import json
import time

import pytest

from rsibr.batches import batch_lock as locks
from rsibr.batches.batch_lock import batch_lock
from rsibr.errors import BakeError


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(locks, "WATCH", 0.2)
    monkeypatch.setattr(locks, "BEAT", 0.05)


def refused(out, shard=None):
    with pytest.raises(BakeError, match="another process runs this batch") as caught, batch_lock(out, shard):
        pass
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_second_batch_on_the_directory_is_refused_in_one_line(tmp_path):
    with batch_lock(tmp_path):
        assert "process " in refused(tmp_path)
        refused(tmp_path, (1, 2))
    with batch_lock(tmp_path):
        pass


def test_shards_of_one_number_run_at_once(tmp_path):
    with batch_lock(tmp_path, (1, 2)), batch_lock(tmp_path, (2, 2)):
        refused(tmp_path, (1, 2))
        refused(tmp_path, (1, 3))
        refused(tmp_path)
    with batch_lock(tmp_path):
        pass


def test_the_note_of_a_process_that_was_killed_here_is_no_obstacle(tmp_path):
    note = {"host": "here", "pid": 1, "system": locks._system(), "beat": 3}
    (tmp_path / ".batch-owner.json").write_text(json.dumps(note))
    (tmp_path / ".batch-owner-1-2.json").write_text(json.dumps(note))
    waited = []
    for shard in (None, (1, 2), (1, 3)):
        with batch_lock(tmp_path, shard, waited.append):
            pass
    assert waited == []


def test_a_batch_of_another_machine_is_found_by_its_beat_where_locks_do_not_reach(tmp_path, monkeypatch):
    waited = []
    with batch_lock(tmp_path):
        monkeypatch.setattr(locks.fcntl, "flock", lambda *_: None)
        monkeypatch.setattr(locks, "_system", lambda: "another")
        with pytest.raises(BakeError, match="another process runs"), batch_lock(tmp_path, None, waited.append):
            pass
    assert len(waited) == 1


@pytest.mark.parametrize("beat", [0, 10**9])
def test_a_batch_of_another_machine_that_has_ended_is_watched_and_then_replaced(tmp_path, beat):
    """Its note may be of any time of day: only whether it changes counts."""
    note = {"host": "there", "pid": 1, "system": "another", "beat": beat}
    (tmp_path / ".batch-owner.json").write_text(json.dumps(note))
    waited, before = [], time.monotonic()
    with batch_lock(tmp_path, None, waited.append):
        assert time.monotonic() - before >= locks.WATCH
    assert waited == ["there ran this batch last: watching for 0 s whether it still does"]


@pytest.mark.parametrize("content", ["", "[]", "{", '{"host": 3}'])
def test_a_damaged_note_is_no_obstacle(tmp_path, content):
    (tmp_path / ".batch-owner.json").write_text(content)
    with batch_lock(tmp_path):
        pass


def test_what_cannot_be_locked_is_one_clear_line(tmp_path):
    (tmp_path / locks.LOCK_NAME).mkdir()
    with pytest.raises(BakeError, match="cannot be written"), batch_lock(tmp_path):
        pass
