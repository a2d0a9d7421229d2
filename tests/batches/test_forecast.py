"""A forecast adds up kinds of jobs; without probes it needs no Mitsuba, and memory for no job."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from rsibr.batches.batch import batch as run_batch
from rsibr.batches.config import RunConfig
from rsibr.batches.document import KindRecord
from rsibr.batches.forecast.forecast import forecast
from rsibr.batches.forecast.kinds import Census, Size
from rsibr.batches.forecast.probe import Planned, Probed
from rsibr.batches.forecast.rates import TYPICAL, Rates, SharedRates
from rsibr.batches.matrix import Matrix
from tests.batches.files import batch

AXES = {
    "material": ["solid-red", {"file": "materials/*.xml"}],
    "environment": ["skies/*.exr"],
    "map.resolution": [16, 32],
    "sampling.seed": [1, 2, 3],
}


def counted(folder, **tables) -> Census:
    census = Census()
    Matrix.of(batch(folder, **tables)).check(census.add)
    return census


def test_jobs_are_counted_by_kind(folder):
    census = counted(folder, matrix=AXES, include=[{"material": "pearl-white", "views.subdivision": 1}])
    assert (census.jobs, census.skies, census.materials) == (37, 3, 4)
    found = [(kind.material, kind.size, kind.count) for kind in census.kinds]
    expected = [(material, Size(12, side, 16), 6) for material in ("solid-red", "chalk", "slate") for side in (16, 32)]
    assert found == [*expected, ("pearl-white", Size(42, 8, 16), 1)]  # neither skies nor seeds make a kind
    assert len(census.groups()) == 4  # sizes do not make a group


def test_sizes_that_are_decided_later_are_said_to_be(folder):
    base = {"environment": {"emitter": {"type": "constant"}}, "material": {"preset": "solid-red"}}
    census = counted(folder, base=base, matrix={"budget.seconds": [10, 20]})
    assert [(kind.seconds, kind.is_open) for kind in census.kinds] == [(10, True), (20, True)]
    found = forecast(census, folder, RunConfig(executor="serial"), None, 0, 0.0)
    assert found.processor_seconds >= 30
    assert any("2 jobs have an error or a budget" in note for note in found.notes)


def test_the_sum_is_that_of_the_parts(folder):
    """Rates that are powers of ten, so that each part of the sum can be seen in it."""
    census = counted(folder, matrix=AXES)
    rates = Rates(100.0, 1.0, 0.0, 0.0, 0.0, 0.0, 7000, 4, 0.0, 0.0, 0.0)
    groups = list(census.groups())
    planned = {id(kind): Planned(Size(1, 8, 16), 100.0) for kind in census.kinds}
    shared = SharedRates(start=10_000.0, imports=2000.0, sky=1_000_000.0, light_bytes=10_000_000.0, lights=2)
    probed = Probed(dict.fromkeys(groups, rates), planned, shared, ("a note",))
    found = forecast(census, folder, RunConfig(executor="serial"), probed, 5, 0.25)
    assert found.processor_seconds == 0.25 + 36 * 1.0 + 3 * 100.0 + 8000.0 + 2 * 1_000_000.0
    assert found.bytes == 36 * 7100 + 4 * 10_000_000  # two lights a sky
    assert found.files == 36 * (4 + 1) + 4
    assert (found.jobs, found.already_done, found.source, found.notes) == (36, 5, "probes", ["a note"])
    assert found.kinds[0] == KindRecord(
        material="solid-red", views=1, resolution=8, samples=16, jobs=6, processor_seconds=1.0, bytes=7100
    )
    many = forecast(census, folder, RunConfig(executor="processes", workers=4), probed, 5, 0.25)
    assert many.processor_seconds == 0.25 + 36 * 1.0 + 3 * 4 * 100.0 + 4 * 10_000.0 + 2 * 4 * 1_000_000.0


def test_work_grows_with_what_it_is_proportional_to():
    one, twice = Size(12, 64, 256), Size(24, 64, 256)
    assert twice.samples_in_all == 2 * one.samples_in_all == 2 * 12 * 64**2 * 256 * 3.141592653589793 / 4
    grown = TYPICAL.job_seconds(twice) - TYPICAL.job_seconds(one)
    assert grown == pytest.approx(TYPICAL.job_seconds(one) - TYPICAL.pair)


def test_a_dry_run_counts_what_is_done_and_writes_nothing(folder, tmp_path):
    tables = {"base": batch(folder).tables.base, "matrix": {"material": ["solid-red", "pearl-white"]}}
    seen = []
    report = run_batch(tables, out=tmp_path / "out", dry_run=True, probe=False, on_forecast=seen.append)
    document = report.document
    assert (document.state, document.jobs, document.done, document.index) == ("forecast", 2, 0, [])
    assert document.forecast == seen[0]
    assert list(tmp_path.iterdir()) == []


MANY = """
import json, sys
from pathlib import Path
from rsibr.batches.batch import batch
report = batch(sys.argv[1], out=sys.argv[2], dry_run=True, probe=False)
mitsuba = [name for name in sys.modules if name.split(".")[0] in ("mitsuba", "drjit")]
status = Path("/proc/self/status")  # unlike ru_maxrss it does not begin with the memory of the process that forked
peak = int(status.read_text().partition("VmHWM:")[2].split()[0]) if status.exists() else 0
print(json.dumps([report.document.jobs, len(report.document.forecast.kinds), mitsuba, peak * 1024]))
"""


def test_many_jobs_need_neither_mitsuba_nor_memory(folder, tmp_path):
    """1000 seeds × 20 angles of a sky; tests/benchmarks/test_dry_run.py has 1000 materials × 200 skies."""
    file = tmp_path / "many.toml"
    file.write_text(
        'base = {environment = {file = "sky.exr"}, material = {preset = "solid-red"}}\n[matrix]\n'
        f'"sampling.seed" = {list(range(1000))}\n"environment.rotation_deg" = {list(range(20))}\n'
    )
    (tmp_path / "sky.exr").write_bytes((folder / "skies" / "noon.exr").read_bytes())
    words = [sys.executable, "-c", MANY, str(file), str(tmp_path / "out")]
    jobs, kinds, mitsuba, peak = json.loads(subprocess.run(words, capture_output=True, check=True).stdout)
    assert (jobs, kinds, mitsuba) == (20_000, 1, [])
    assert peak < 150e6
