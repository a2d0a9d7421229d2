"""Pictures of a convex object: time of a ray that meets it, and that of path tracing to the same error."""

import numpy as np
import pytest
import trimesh

from rsibr.baking.baker import bake
from rsibr.resources import scenes
from rsibr.scene.config import parse_config
from rsibr.shading.cameras.fitted_camera import fitted_camera
from rsibr.shading.renderer import ObjectRenderer
from rsibr.shading.scenes.scene_file import open_scene
from rsibr.validation.objects.validation import validate_object
from tests.benchmarks.turns import in_turns

METHODS = ("nearest", "cabral1999", "rsibr")
ROUNDS, SAMPLES, RAYS = 6, 256, 16


@pytest.fixture(scope="module")
def capsule(tmp_path_factory):
    """Capsule with normals of its own, 0.1 million triangles."""
    path = tmp_path_factory.mktemp("meshes") / "capsule.ply"
    trimesh.creation.capsule(height=1.2, radius=0.5, count=[256, 256]).export(path)
    return open_scene(path)


@pytest.mark.benchmark(group="a picture of a capsule, 1920 × 1080, 4 rays a pixel")
@pytest.mark.parametrize("material", ["glossy-plastic", "clearcoat-red", "rough-aluminium"])
def test_a_picture_by_each_method(benchmark, tmp_path, capsule, material):
    """Time at 1080p in turns; errors and path tracing at 256², 16 rays; `extra_info`: ns a hit, ratios, relMSE."""
    data = {
        "environment": {"file": str(scenes() / "environments" / "city.exr")},
        "material": {"preset": material},
        "map": {"resolution": 160},
        "sampling": {"samples": SAMPLES},
    }
    bakes = {"*": bake(parse_config(data, scenes()), out=tmp_path / "paint.rsibr")}
    large, small = (fitted_camera(capsule, width=w, height=h) for w, h in ((1920, 1080), (256, 256)))
    renderers = {name: ObjectRenderer(capsule, bakes, name, occlusion="off") for name in METHODS}
    hits = {name: one.picture(large, rays=4).counts.hits for name, one in renderers.items()}

    def drawing(one):
        return lambda _call: one.picture(large, rays=4)

    seconds = in_turns({name: drawing(one) for name, one in renderers.items()}, rounds=ROUNDS)
    benchmark.pedantic(drawing(renderers["rsibr"]), args=(0,), rounds=ROUNDS)
    nanoseconds = {name: 1e9 * float(np.median(taken)) / hits[name] for name, taken in seconds.items()}
    judged = validate_object(capsule, bakes, camera=small, methods=METHODS, occlusion="off", rays=RAYS, samples=SAMPLES)
    benchmark.extra_info.update(nanoseconds=nanoseconds)
    for name, one in judged.methods.items():
        pixels = one.picture.counts.hits / RAYS
        traced, ours = 1e9 * one.path_tracing_seconds / pixels, RAYS * nanoseconds[name]
        told = f"{nanoseconds[name]:.0f} ns a hit, relMSE {one.open.whole.rel_mse}"
        times = f"{RAYS} rays {ours / 1e3:.1f} µs, path-traced to that error {traced / 1e3:.0f}: {traced / ours:.0f}×"
        print(f"\n{material}, {name}: {told}, {times}", end="")  # noqa: T201
