"""A method is one file: registered by a decorator or an entry point, and seen by all that judges and lists methods."""

import json
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import rsibr
from rsibr.errors import BakeError, InputError
from rsibr.geometry.frame import view_frame
from rsibr.methods import Method, PointwiseMethod, register, registry
from rsibr.methods.method_set import MethodSet
from rsibr.methods.registry import (
    available,
    baseline_method,
    default_method,
    method_names,
    registration,
    registrations,
    unregister,
)
from rsibr.registered import load_entry_point
from rsibr.store.bake import Bake
from tests.arrays import to_numpy, unit_vectors, vector

TOY = """
import mitsuba as mi
from rsibr.methods import PointwiseMethod, register


@register("grey", summary="one grey for every surface and view")
class Grey(PointwiseMethod):
    def eval(self, n, v):
        return mi.Color3f(0.5)
"""


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """The ten lines of a user, found as an entry point of a package of theirs."""
    (tmp_path / "toy_grey.py").write_text(TOY)
    monkeypatch.syspath_prepend(tmp_path)
    method_names()  # what is found by itself has been found by now
    load_entry_point(EntryPoint("grey", "toy_grey", registry.ENTRY_POINTS))
    yield "grey"
    unregister("grey")
    monkeypatch.delitem(sys.modules, "toy_grey")


def test_methods_are_in_the_order_of_tables_and_have_their_roles():
    assert method_names()[:6] == ("nearest", "blend", "cabral1999", "cabral1999-mesh", "rsibr", "rsibr-fine")
    assert (default_method(), baseline_method()) == ("rsibr", "cabral1999")
    assert all(one.summary and "\n" not in one.summary for one in registrations().values())


def test_an_unknown_method_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match=r"method: unknown method 'cabral99'. Did you mean 'cabral1999'\? there are: "):
        registration("cabral99")


def test_a_module_that_cannot_be_loaded_is_named(tmp_path, monkeypatch):
    (tmp_path / "toy_broken.py").write_text("1 / 0")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"entry point 'x' of rsibr.methods \(toy_broken\): .*ZeroDivisionError"):
        load_entry_point(EntryPoint("x", "toy_broken", registry.ENTRY_POINTS))


def test_a_set_of_methods_is_a_mapping_of_what_the_bake_serves(small_bakes):
    whole = small_bakes("rough-aluminium")
    methods = MethodSet(whole)
    assert list(methods) == list(available(whole)) == list(method_names())
    assert len(methods) == len(method_names())
    assert "rsibr" in methods
    assert "velvet" not in methods
    assert methods["rsibr"] is methods["rsibr"]
    assert all(isinstance(methods[name], Method) and methods[name].name == name for name in methods)
    assert repr(methods).startswith("MethodSet('rough-aluminium.rsibr': nearest, ")
    lobeless = Bake(whole.path, whole.manifest.model_copy(update={"lobes": ()}))
    assert "rsibr" not in MethodSet(lobeless)
    assert default_method(lobeless) == "cabral1999"
    with pytest.raises(BakeError, match="its lobes are not stored separately"):
        MethodSet(lobeless)["rsibr"]


def test_preparation_counts_what_methods_share_for_each_of_them(small_bakes):
    """Decoding the maps and the light is done once, and counts for every method that reads them."""
    methods = MethodSet(small_bakes("rough-aluminium"))
    first, second = methods["cabral1999"].cost, methods["blend"].cost
    shared = methods.inputs._seconds
    for cost in (first, second):
        assert cost.prepare_seconds >= shared["sources"] + shared["maps"] > 0
    assert methods["rsibr"].cost.prepare_seconds > shared["pyramid"] + shared["light"] + shared["maps"]
    assert methods["rsibr"].cost.device_bytes > methods["cabral1999"].cost.device_bytes > 12 * 48**2 * 8


def test_a_toy_of_ten_lines_is_seen_everywhere(toy, small_bakes, tmp_path):
    """reconstruct, validate, its metrics and its report, and study: no other file knows its name."""
    bake = small_bakes("rough-aluminium")
    assert len(TOY.strip().splitlines()) <= 10
    assert toy in method_names()
    made = rsibr.reconstruct(bake, view=(1, 2, 3), method=toy)
    assert np.unique(made.image[made.coverage > 0]).tolist() == [0.5]

    found = rsibr.validate(bake, views=1, methods=[toy, "cabral1999"], samples=64, out=tmp_path / "report")
    assert found.summary[toy].rel_mse.value > found.summary["cabral1999"].rel_mse.value > 0
    metrics = json.loads((tmp_path / "report" / "metrics.json").read_text())
    assert metrics["summary"][toy]["eval_rel_mse"]["value"] == pytest.approx(found.summary[toy].rel_mse.value, rel=1e-4)
    assert f'<th scope="row">{toy}</th>' in (tmp_path / "report" / "report.html").read_text()

    base = {key: value for key, value in bake.manifest.config.items() if value is not None}
    study = {
        "base": base,
        "method": [toy],
        "sweep": [{"samples": [4], "resolution": [16]}],
        "judge": {"views": 1, "samples": 64, "repeats": 3},
        "path_tracing": {"samples": [4, 9, 16]},
    }
    done = rsibr.study(study, out=tmp_path / "study")
    assert [point.method for point in done.points()] == [toy]
    assert toy in (tmp_path / "study" / "study.html").read_text()


def test_a_pointwise_method_compiles_nothing_from_view_to_view(rng):
    import drjit as dr

    class Cosine(PointwiseMethod):
        def eval(self, n, v):
            return mi.Color3f(dr.dot(n, v))

    made = Cosine(None)
    frames = [view_frame(v) for v in unit_vectors(rng, 4)]
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        images = [made.map(frame, 32).numpy() for frame in frames[:1]]
        dr.kernel_history_clear()
        images += [made.map(frame, 32).numpy() for frame in frames[1:]]
        assert all(kernel["cache_hit"] for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT)
    for image in images[1:]:  # the cosine to one's own viewer is the same picture from everywhere
        assert np.allclose(image, images[0], atol=1e-6)


@pytest.mark.parametrize("name", ["rsibr", "rsibr-fine"])
@pytest.mark.slow
def test_methods_evaluate_points_by_themselves(name, small_bakes, rng):
    """`rsibr` integrates no wide Gaussian at a point: its `eval` is its own, and close to that of `rsibr-fine`."""
    methods = MethodSet(small_bakes("clearcoat-red"))
    v = unit_vectors(rng, 4000)
    n = unit_vectors(rng, 4000)
    cosine = (n * v).sum(axis=1, keepdims=True)
    n, above = n * np.sign(cosine), np.abs(cosine[:, 0]) > 0.2
    shown = {one: to_numpy(methods[one].eval(vector(n), vector(v))).T[above] for one in ("rsibr", "rsibr-fine")}
    fine = shown["rsibr-fine"]
    error = ((shown["rsibr"] - fine) ** 2 / (fine**2 + (0.1 * fine.mean(axis=0)) ** 2)).mean()
    assert not np.array_equal(shown["rsibr"], fine)
    assert error < 1e-3
    assert np.isfinite(shown[name]).all()
    assert shown[name].min() >= 0


def test_every_file_of_a_method_is_found_by_itself():
    """No list names them: each is a module below the folder of methods."""
    folder = Path(registry.__file__).parent
    assert {one.make.__module__ for one in registrations().values() if not one.alias_of} >= {
        f"rsibr.methods.{'.'.join(path.relative_to(folder).with_suffix('').parts)}"
        for path in folder.rglob("*.py")
        if "@register(" in path.read_text() and path.name not in ("registry.py", "protocol.py")
    }


def test_register_returns_what_it_decorates():
    @register("one-more", summary="for this test")
    def make(inputs):
        raise NotImplementedError

    try:
        assert registration("one-more").make is make
        assert registration("one-more").options == {}
        assert registration("cabral1999").options == {"weights": "area", "mesh": None}
    finally:
        unregister("one-more")
