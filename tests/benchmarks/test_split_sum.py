"""GGX-prefiltered cubes: processor time and error of ours and of Filament's `cmgen`, of the same light, in one run.

`cmgen` is looked for on the PATH (Debian: `libfilament-tools`); without it only ours is measured.
"""

import resource
import shutil
import subprocess
import time

import numpy as np
import OpenEXR
import pytest

from rsibr.geometry.projections.cube import CUBE
from rsibr.geometry.projections.faces import FACES
from rsibr.geometry.projections.sphere_image import texel_directions, texel_solid_angles
from rsibr.methods.split_sum.multilevel_sum import PointSources
from rsibr.methods.split_sum.prefiltered_cube import prefiltered
from tests.methods.split_sum.lights import brute, lamps
from tests.scene.maps import write_exr

ROUGHNESS, SIZE = 0.3, 256  # perceptual: α = 0.09
HEIGHT = 256
PLACES = 300
SAMPLES = (1024, 4096)


@pytest.fixture(scope="module")
def sky():
    """Lamps over a sky as a latitude–longitude image of centred texels in cmgen's orientation, and as point sources."""
    edges = np.cos(np.arange(HEIGHT + 1) * np.pi / HEIGHT)
    polar, turn = ((np.arange(n) + 0.5) * np.pi / HEIGHT for n in (HEIGHT, 2 * HEIGHT))
    sine = np.sin(polar)[:, None]
    parts = -sine * np.sin(turn), np.cos(polar)[:, None] + 0 * turn, -sine * np.cos(turn)
    directions = np.stack(parts, axis=-1).reshape(-1, 3)
    angles = np.repeat(-np.diff(edges) * np.pi / HEIGHT, 2 * HEIGHT)[:, None]
    radiance = lamps(directions).astype(np.float32)
    return radiance.reshape(HEIGHT, -1, 3), PointSources(
        directions, np.concatenate([radiance * angles, angles], axis=1)
    )


@pytest.fixture(scope="module")
def judge(sky):
    """Return a function: cube → root mean square error over that of the truth at random texels, and energy ratio."""
    _, sources = sky
    chosen = np.random.default_rng(5).choice(6 * SIZE * SIZE, PLACES, replace=False)
    places = np.array(texel_directions(CUBE, SIZE), dtype=np.float64).T[chosen]
    truth = brute(sources, ROUGHNESS**2, places)

    def judged(cube):
        error = np.sqrt(((cube.reshape(-1, 3)[chosen] - truth) ** 2).mean() / (truth**2).mean())
        energy = np.einsum("fhw,fhwc->", texel_solid_angles(CUBE, SIZE), cube) / sources.weights[:, :3].sum()
        return float(error), float(energy)

    return judged


def told(name, seconds, error, energy):
    print(f"\n  {name}: {seconds:.2f} s of processor time, relRMSE {100 * error:.2f} %, energy {energy:.4f}")  # noqa: T201


@pytest.mark.benchmark(group="a GGX-prefiltered cube")
def test_ours(benchmark, sky, judge):
    """Below 1 %, and within 0.2 % of the energy."""
    _, sources = sky
    prefiltered(sources, ROUGHNESS**2, SIZE)  # compiles
    start = time.process_time()
    cube = benchmark.pedantic(
        prefiltered, (PointSources(sources.directions, sources.weights), ROUGHNESS**2, SIZE), rounds=1
    )
    seconds = time.process_time() - start
    error, energy = judge(cube)
    benchmark.extra_info.update(processor_seconds=seconds, error=error, energy=energy)
    told(f"ours, {SIZE}²", seconds, error, energy)
    assert error < 0.01
    assert abs(energy - 1) < 0.002


@pytest.mark.benchmark(group="a GGX-prefiltered cube")
@pytest.mark.skipif(shutil.which("cmgen") is None, reason="no cmgen on the PATH")
@pytest.mark.parametrize("samples", SAMPLES)
def test_cmgen(benchmark, sky, judge, tmp_path, samples):
    """Its `--extract-blur`: the kernel of the same roughness, by so many samples a texel."""
    write_exr(tmp_path / "sky.exr", sky[0])
    command = ["cmgen", "-q", "--no-mirror", "--format=exr", "--compression=RAW", f"--size={SIZE}"]
    command += [f"--ibl-samples={samples}", f"--extract={tmp_path}", f"--extract-blur={ROUGHNESS}"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    benchmark.pedantic(subprocess.run, ([*command, str(tmp_path / "sky.exr")],), {"check": True}, rounds=1)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    cube = []
    for face in FACES:
        with OpenEXR.File(str(tmp_path / "sky" / f"{face}.exr")) as file:
            cube.append(np.array(file.channels()["RGB"].pixels, dtype=np.float64))
    error, energy = judge(np.stack(cube))
    benchmark.extra_info.update(processor_seconds=seconds, error=error, energy=energy)
    told(f"cmgen, {SIZE}², {samples} samples", seconds, error, energy)
