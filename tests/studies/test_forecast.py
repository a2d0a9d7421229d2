"""The forecast of a study: closed forms from given rates, and rates that the miniature measures."""

from __future__ import annotations

import math

import pytest

from rsibr.baking.remembered import in_this_process
from rsibr.studies.agenda import agenda_of, variant_as_is
from rsibr.studies.config import parse_study
from rsibr.studies.forecast import Forecast
from rsibr.studies.rates import BakeRates, MethodRates, PathTracingRates, Rates
from rsibr.studies.runner import BAKES_NAME, _benches
from rsibr.studies.speed_probe import measure_rates
from tests.studies.conftest import tables

RATES = Rates(
    views=12,
    resolution=16,
    judged=2,
    repeats=3,
    path_tracing=PathTracingRates(launch_seconds=0.1, sample_seconds=1e-5, compile_seconds=2.0, scene_seconds=3.0),
    bake=BakeRates(setup_seconds=0.5, view_seconds=0.01, store_seconds=0.02, sample_seconds=1e-6, scene_seconds=7.0),
    methods={
        "cabral1999": MethodRates(
            point_seconds=0.3, compile_seconds=0.2, frame_seconds=1e-3, lookup_seconds=1e-8, preparations=2
        ),
        "rsibr": MethodRates(
            point_seconds=3.0, compile_seconds=1.0, frame_seconds=1e-2, lookup_seconds=1e-7, preparations=4
        ),
    },
    decode_seconds=0.005,
    compare_seconds=0.05,
    reread_seconds=0.01,
    figure_seconds=0.4,
)


def forecast_of(settings, folder, measured):
    study = parse_study(settings)
    agenda = agenda_of(study)

    def measure(*_):
        measured.append(1)
        return RATES

    return Forecast(_benches(study, agenda, folder), agenda, study.path_tracing, measure)


def by_name(steps):
    return {step.name: step.seconds for step in steps}


def test_steps_follow_from_the_rates(asymmetric_environment, tmp_path):
    settings = tables(asymmetric_environment)
    settings["scenes"] = {"material": ["glossy-plastic", "clearcoat-red"]}
    settings["sweep"][0]["subdivision"] = [0, 1]
    forecast = forecast_of(settings, tmp_path, [])
    first, second = (by_name(forecast.steps(number)) for number in (0, 1))
    launch = 0.1 + 256 * 35 * 1e-5  # 256 samples in 8 buffers: 32, in 5 × 7 strata
    assert first["reference 1"] == pytest.approx(8 * launch + launch + 2.0)  # one to warm up, one to compile
    assert first["reference 2"] == pytest.approx(8 * launch)
    assert second["reference 1"] == pytest.approx(first["reference 1"] + 3.0)  # the probe built the first scene
    assert first["bake of 12 views, 16², 64 samples"] == pytest.approx(
        0.5 + 12 * (0.03 + math.pi / 4 * 256 * 64 * 1e-6)
    )
    assert first["rsibr of 12 views"] == pytest.approx(3.0)  # compiled by the probe
    assert first["rsibr of 42 views"] == pytest.approx(3.0 + 30 * (2 * 0.005 + 4 * 1e-2))
    assert first["cabral1999, mesh-4x12, float16 of 12 views"] == pytest.approx(0.3 + 0.2)  # another kernel
    assert second["cabral1999, mesh-4x12, float16 of 12 views"] == pytest.approx(0.3)
    assert second["rsibr of 12 views"] == pytest.approx(3.0 * (2 + 3) / 4)  # prepared for each of three lobes, not two
    lobes = first["lobes of reference 1"]
    assert second["lobes of reference 1"] == pytest.approx(lobes + 7.0)  # its lobes are fitted there
    assert forecast.page_seconds == pytest.approx(0.4 * 7 + 0.01 * 2 * 2)


def test_of_errors_alone_nothing_else_is_done(asymmetric_environment, tmp_path):
    settings = tables(asymmetric_environment)
    settings["judge"]["errors_only"] = True
    steps = by_name(forecast_of(settings, tmp_path, []).steps(0))
    assert not [name for name in steps if name.startswith(("lobes", "path tracing"))]
    assert steps["rsibr of 12 views"] == pytest.approx(3.0 / 4)  # made ready once, not with noise and for two lobes


def test_more_judged_views_and_repeats_take_longer(asymmetric_environment, tmp_path):
    settings = tables(asymmetric_environment)
    settings["judge"] |= {"views": 4, "repeats": 5}
    found = by_name(forecast_of(settings, tmp_path, []).steps(0))["rsibr of 12 views"]
    lookups = 2 * 4 * math.pi / 4 * 256 * 1e-7  # a run that compiles and one that is timed, four points a texel
    more = 4 * (0.05 + (1 + 5 + 4) * 1e-2 + lookups) - 2 * (0.05 + (1 + 3 + 4) * 1e-2 + lookups)
    assert found == pytest.approx(3.0 + more)


def test_a_finished_study_measures_nothing(small, asymmetric_environment):
    measured = []
    assert forecast_of(tables(asymmetric_environment), small.out, measured).steps(0) == []
    assert measured == []


def test_a_resumed_study_measures_nothing_again_and_compiles_anew(asymmetric_environment, tmp_path):
    measured, settings = [], tables(asymmetric_environment)
    before = by_name(forecast_of(settings, tmp_path, measured).steps(0))
    after = by_name(forecast_of(settings, tmp_path, measured).steps(0))
    assert measured == [1]
    assert after["reference 1"] == pytest.approx(before["reference 1"] + 3.0)
    assert after["rsibr of 12 views"] == pytest.approx(before["rsibr of 12 views"])  # the last of three bakes
    settings["method"].append("nearest")
    assert forecast_of(settings, tmp_path, measured).rates is RATES
    assert measured == [1, 1]  # of another method the speed is not known


@pytest.mark.slow
def test_the_miniature_measures_every_part_and_leaves_nothing(asymmetric_environment, tmp_path):
    in_this_process.forget()  # what earlier tests have probed and fitted would cost nothing
    study = parse_study(tables(asymmetric_environment))
    agenda = agenda_of(study)
    (bench,) = _benches(study, agenda, tmp_path)
    compiled = {}
    rates = measure_rates(bench.scene, agenda, bench.judged.frames, compiled)
    assert (rates.views, rates.resolution, rates.judged) == (12, 16, 2)
    assert set(rates.methods) == {"cabral1999", "rsibr"}
    assert rates.methods["rsibr"].preparations == 2 + len(bench.scene.prepared.lobes)
    assert all(one.point_seconds > one.frame_seconds > one.lookup_seconds > 0 for one in rates.methods.values())
    assert rates.bake.scene_seconds > 0
    assert rates.path_tracing.launch_seconds + rates.path_tracing.sample_seconds > 0
    assert min(rates.decode_seconds, rates.compare_seconds, rates.figure_seconds) > 0
    assert set(compiled) == {"bake", *(str(variant_as_is(name)) for name in rates.methods)}
    assert not (tmp_path / BAKES_NAME).exists()
    assert [path.suffix for path in (tmp_path / "journal").iterdir()] == []
