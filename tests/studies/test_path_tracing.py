"""Path tracing as a rival: unbiased, independent of the references, and of the slope that theory gives."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.studies.convergence import fit_power_law
from rsibr.studies.path_tracing import PathTracer, path_tracing_points
from rsibr.validation.flip import exposures_for
from tests.validation.doubles import LAMBERT, Matter, slanted_sky

FRAME = view_frame((1, 2, 3))
PLASTIC = Matter({"type": "roughplastic", "alpha": 0.1})
RESOLUTION = 24


@pytest.fixture(scope="module")
def tracer():
    return PathTracer(slanted_sky(64), PLASTIC, RESOLUTION)


def seeds(number):
    return np.random.SeedSequence(number)


def test_a_picture_is_that_of_the_reference(tracer):
    """Mean z over the texels is normal: |z̄|·√n < 4.5, false alarm 7e-6."""
    reference = tracer.render(FRAME, 1024, seed=1)
    image, seconds = tracer.picture(FRAME, 1024, seeds(1))
    judged = reference.coverage > 0.99
    z = (image - reference.mean)[judged] / np.sqrt(2 * reference.variance_of_mean[judged] + 1e-20)
    grey = z.mean(axis=-1)  # the channels share their samples
    assert abs(grey.mean()) * np.sqrt(grey.size) < 4.5 * max(1.0, grey.std())
    assert seconds > 0


def test_its_seeds_alone_decide(tracer):
    first, again, other = (tracer.picture(FRAME, 16, seeds(n))[0] for n in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_it_shares_no_noise_with_the_reference(tracer):
    """Errors of the rival and of the reference, from the same root seed, do not correlate: |r|·√n < 4.5."""
    truth = tracer.render(FRAME, 4096, seed=99)
    reference = tracer.render(FRAME, 64, seed=0)
    rival, _ = tracer.picture(FRAME, 64, np.random.SeedSequence(0))
    judged = truth.coverage > 0.99
    ours, theirs = ((image - truth.mean)[judged].mean(axis=-1) for image in (rival, reference.mean))
    correlation = np.corrcoef(ours, theirs)[0, 1]
    # The truth's own noise is in both; it is a sixty-fourth of theirs
    assert abs(correlation - 1 / 65) * np.sqrt(ours.size) < 4.5


@pytest.mark.slow
def test_passes_have_the_slope_of_independent_samples(tracer):
    """In samples, which no clock disturbs: −1 ± 0.05 over 1.5 decades; one stratified picture is no worse."""
    frames, reference = [FRAME] * 4, tracer.render(FRAME, 16384, seed=5)
    counts = [16, 64, 256, 512]
    options = {"seed": 0, "runs": 4}
    arguments = (tracer, frames, [reference] * 4, exposures_for(1.0), counts)
    passes, whole = (path_tracing_points(*arguments, pass_samples=n, **options) for n in (16, None))
    errors = [record.error.rel_mse.value for record in passes]
    assert fit_power_law(counts, errors).slope == pytest.approx(-1, abs=0.05)
    assert whole[-1].error.rel_mse.value < 1.05 * errors[-1]
    assert [record.samples for record in passes] == counts
    assert [record.samples for record in whole] == [16, 64, 256, 528]
    assert all(record.seconds.low <= record.seconds.median <= record.seconds.high for record in whole)


def test_samples_are_counted_as_they_are_taken(tracer, monkeypatch):
    assert tracer.launches(128) == (1, 132)  # 11 × 12 strata
    assert tracer.launches(100, 16) == (7, 16)
    taken = []
    tracer = PathTracer(slanted_sky(64), LAMBERT, RESOLUTION, max_lanes=50 * RESOLUTION**2)
    monkeypatch.setattr(tracer, "_film", lambda seed, spp: taken.append(spp) or np.ones((RESOLUTION, RESOLUTION, 4)))
    assert tracer.launches(128) == (3, 48)  # 43 at least
    tracer._compiled.add(48)
    tracer.picture(FRAME, 128, seeds(0))
    assert taken == [48] * 3


def test_coverage_is_divided_out():
    image, _ = PathTracer(slanted_sky(64), LAMBERT, 16).picture(FRAME, 64, seeds(0))
    assert image[8, 8].min() > 0
    assert image[0, 0].max() == 0
    assert np.isfinite(image).all()
