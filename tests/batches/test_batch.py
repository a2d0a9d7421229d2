"""What is done does not run again, what is in the way is told before anything runs, and shards share the work."""

from __future__ import annotations

from pathlib import Path

import pytest

from rsibr.batches.batch import batch as run_batch
from rsibr.batches.batch import reindex
from rsibr.batches.document import batch_schema
from rsibr.batches.matrix import Matrix
from rsibr.batches.result import JobResult, write_result
from rsibr.errors import BakeError, InputError
from tests.batches.files import BASE, batch

TABLES = {"base": BASE, "matrix": {"material": ["solid-red", "pearl-white"], "sampling.seed": [0, 1]}}
ROOT = Path(__file__).parents[2]


def done(out: Path, tables=TABLES, **fields) -> list[str]:
    """Write the results of all jobs, as if they had run."""
    matrix = Matrix.of(batch(".", **tables))
    matrix.check()
    names = []
    for job in matrix.jobs():
        (out / job.bake).mkdir(parents=True)
        (out / job.bake / "manifest.json").write_text("{}")
        write_result(out, JobResult.of(job, "done", **fields))
        names.append(job.name)
    return names


def dry(out: Path, tables=TABLES, **options):
    return run_batch(tables, out=out, dry_run=True, probe=False, **options).document


def test_what_is_done_does_not_run_again(tmp_path):
    names = done(tmp_path)
    assert (dry(tmp_path).already_done, dry(tmp_path).forecast.jobs) == (4, 0)
    (tmp_path / "results" / f"{names[0]}.json").unlink()
    (tmp_path / f"{names[1]}.rsibr" / "manifest.json").unlink()
    (tmp_path / "results" / f"{names[2]}.json").write_text("{")
    assert dry(tmp_path).forecast.jobs == 3


def test_steps_that_are_asked_for_later_run(tmp_path):
    done(tmp_path)
    assert dry(tmp_path, {**TABLES, "then": {"validate": {"views": 2}}}).forecast.jobs == 4


def test_bakes_of_other_settings_are_told_before_anything_runs(tmp_path):
    names = done(tmp_path)
    with pytest.raises(BakeError, match=rf"{names[0]} \(the settings changed\); {names[1]} .*Choose another --out"):
        dry(tmp_path, overrides=["map.resolution=16"])


def test_bakes_of_other_content_are_told_before_anything_runs(folder, tmp_path):
    """Their materials and skies are loaded anyhow, to find mistakes."""
    from rsibr.batches.check import check_contents
    from rsibr.batches.resume import DoneJobs

    matrix = Matrix.of(batch(folder, matrix={"material": [{"file": "materials/chalk.xml"}]}))
    matrix.check()
    (job,) = matrix.jobs()
    contents = check_contents(matrix)
    (tmp_path / job.bake).mkdir()
    (tmp_path / job.bake / "manifest.json").write_text("{}")
    known = DoneJobs(tmp_path, contents)
    now = {kind: next(iter(found.values())) for kind, found in contents.items()}
    write_result(tmp_path, JobResult.of(job, "done", contents=now))
    assert known.has(job)
    assert known.obstacle(job) == ""
    write_result(tmp_path, JobResult.of(job, "done", contents={**now, "material": "0" * 64}))
    assert not known.has(job)
    assert known.obstacle(job) == "the content of the material"
    assert DoneJobs(tmp_path, {}).has(job)  # nothing is known of the content


@pytest.mark.parametrize("of", [1, 2, 3, 5])
def test_shards_have_each_job_once(tmp_path, of):
    found = [dry(tmp_path, shard=(number, of)).jobs for number in range(1, of + 1)]
    assert sum(found) == 4
    assert max(found) - min(found) <= 1


def test_a_place_that_is_no_place_for_a_batch_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"):
        dry(tmp_path / "file")
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(InputError, match="is a bake"):
        dry(tmp_path)


def test_the_index_is_made_anew(tmp_path):
    done(tmp_path, bytes=100)
    document = reindex(tmp_path, "title").document
    assert (document.state, document.jobs, document.done, document.damaged) == ("indexed", 4, 4, [])
    assert document.bytes == 400
    assert [Path(path).name for path in document.index] == ["index.sqlite", "index.csv", "index.parquet"]
    assert "pearl-white/1" in (tmp_path / "gallery.html").read_text()
    with pytest.raises(InputError, match="holds no results of a batch"):
        reindex(tmp_path / "index.csv")


def test_the_schema_is_that_of_the_code():
    assert (ROOT / "docs" / "batch.schema.json").read_text(encoding="utf-8") == batch_schema()
