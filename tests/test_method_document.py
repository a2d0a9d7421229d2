"""docs/method.md: what it refers to exists, and the numbers and identities that it states are those of the code."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.viewpoints import icosphere
from rsibr.lobes.facet_moments import cosines, facet_moments, matte_energy
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.lobes.microfacet import transmitted
from rsibr.lobes.probe_directions import probe_directions
from rsibr.lobes.shape_fit import sigmas
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.rsibr.anisotropic_footprint import tap_spreads
from rsibr.methods.rsibr.fidelity import FAST, FINE
from rsibr.methods.rsibr.half_vector_pyramid import (
    LADDER,
    RESOLUTION,
    HalfVectorPyramid,
    level_variances,
    taps,
    texel_angle,
)
from rsibr.methods.rsibr.half_vector_quadrature import _blobs, _HalfVectors
from rsibr.methods.rsibr.lobe_weights import LEVELS, _mixture, _shares
from rsibr.methods.rsibr.microfacet_reflection import reflected
from rsibr.methods.rsibr.polar_grid import NODES
from rsibr.methods.rsibr.residual_transport import BRIGHTEST, DARKEST
from rsibr.methods.rsibr.view_nodes import SUBDIVISION
from tests.arrays import to_numpy, vector

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "docs" / "method.md").read_text()
FLOW = " ".join(TEXT.split())
"""The text in one line."""

REFERENCE = re.compile(r"`(\w+\.py):([\w.]+)`")


@cache
def sources() -> dict[str, list[Path]]:
    """Files of the package by their names."""
    found: dict[str, list[Path]] = {}
    for path in sorted((ROOT / "rsibr").rglob("*.py")):
        found.setdefault(path.name, []).append(path)
    return found


@cache
def names_of(path: Path) -> frozenset[str]:
    """What a module defines: functions, classes and their members as `Class.member`, constants."""
    return frozenset(_defined(ast.parse(path.read_text()).body))


def _defined(body: list[ast.stmt], prefix: str = "") -> Iterator[str]:
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield prefix + node.name
        if isinstance(node, ast.ClassDef):
            yield from _defined(node.body, f"{node.name}.")
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        yield from (prefix + name.id for t in targets if t for name in ast.walk(t) if isinstance(name, ast.Name))


def home(file: str, name: str) -> list[Path]:
    """Files called so that define a name."""
    return [path for path in sources().get(file, []) if name in names_of(path)]


def test_every_reference_names_one_thing_in_the_source():
    found = REFERENCE.findall(TEXT)
    assert len(set(found)) > 50
    wrong = {f"{file}:{name}" for file, name in found if len(home(file, name)) != 1}
    assert not wrong


def test_the_constants_are_those_of_the_code():
    rows = re.findall(r"\| [^|]+ \| ([\d.]+) \| `(\w+\.py):([A-Z_]+)` \|", TEXT)
    assert len(rows) > 20
    for value, file, name in rows:
        (path,) = home(file, name)
        module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
        assert getattr(module, name) == float(value), name


def test_the_fidelities_are_those_quoted():
    assert (FAST.resolution, FINE.resolution) == (RESOLUTION, 192)
    assert "$G$ is 96 for `rsibr` and 192 for `rsibr-fine`" in FLOW
    assert (FAST.points, FINE.points) == (224, 320)
    assert "about $M$ remain: 224 for `rsibr`, 320 for `rsibr-fine`" in FLOW
    assert (FAST.ratio, FINE.ratio) == (float("inf"), 1.6)


def test_the_dictionary_and_the_directions_are_as_many_as_stated():
    assert f"{len(sigmas())} widths" in FLOW
    assert f"down to {sigmas()[0]:.4f}" in FLOW
    assert f"{len(probe_directions().wi)} pairs" in FLOW


def test_the_size_of_the_view_nodes_is_that_stated():
    views = len(icosphere(SUBDIVISION))
    assert f"{views}\\cdot{NODES}\\cdot16$ bytes, {views * NODES * 16 / 2**20:.0f} MiB" in FLOW


def test_the_table_of_levels_is_that_of_the_code():
    rows = np.array(re.findall(r"\| (\d) \| (\d) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|", TEXT), dtype=float)
    assert rows[:, 0].tolist() == list(range(LEVELS))
    assert rows[:, 1:3] == pytest.approx(np.array(LADDER), abs=5e-5)
    assert rows[:, 3] == pytest.approx(level_variances(), abs=5e-5)
    assert rows[:, 4] == pytest.approx(np.sqrt(level_variances()) * texel_angle(96, np.array(0.0)), abs=5e-5)


def test_variances_in_the_collapsed_map_are_those_of_equations_24_and_25():
    first = LADDER[0][1] + 1 / 6
    added = [3 / 16 * sum(4**i for i in range(1, k + 1)) + 1 / 6 for k, _ in LADDER]
    assert [variance for _, variance in LADDER] == pytest.approx(first * 2.0 ** np.arange(LEVELS) - added)
    assert level_variances() == pytest.approx(first * 2.0 ** np.arange(LEVELS))


def test_kernels_between_levels_have_the_taps_and_the_variances_stated():
    for first, quoted in ((1, "0.0705, 0.2445, 0.3700 and mirrored. Halving"), (2, "0.0405, 0.1553, 0.3042 and")):
        assert quoted in FLOW
        wanted = [float(tap) for tap in re.findall(r"0\.\d+", quoted)]
        for level in range(first, LEVELS - 1, 2):
            (k, before), (_, after) = LADDER[level : level + 2]
            kernel = taps(LADDER[level], LADDER[level + 1])
            assert kernel[:3] == pytest.approx(wanted, abs=5e-5)
            places = np.arange(len(kernel)) - (len(kernel) - 1) / 2
            assert kernel @ places**2 == pytest.approx((after - before) / 4**k)


@pytest.mark.parametrize("level", [0, 2, 3, 6, 9])
def test_the_levels_and_their_collapse_widen_as_equations_23_to_25_say(level):
    """A parabola comes back with the variance added, whatever the kernels are.

    Here the lookup in the level itself is at the texels' centres and the collapsed map is not looked up.
    """
    g = 256
    column = (np.arange(g + 2) - (g + 1) / 2) / g
    x = np.tile(column, g + 2)
    texels = np.stack([x**2, x**2, x**2, np.ones_like(x)], axis=1).astype(np.float32)
    pyramid = HalfVectorPyramid._over(mi.Float(texels.ravel()), g)
    weights = [CosineTable.of(np.tile([w, w, w, 1.0], (5, 1))) for w in np.arange(LEVELS) == level]
    found = to_numpy(pyramid.collapsed(weights))[0]
    middle = (np.abs(x) < 0.05) & (np.abs(np.repeat(column, g + 2)) < 0.05)
    added = (found - x**2)[middle].mean() * g**2
    halvings, variance = LADDER[level]
    stated = variance - LADDER[0][1] + 3 / 16 * sum(4**i for i in range(1, halvings + 1))
    assert added == pytest.approx(stated, rel=2e-3, abs=2e-3)


def test_a_mixture_of_three_levels_errs_as_little_as_quoted():
    steps = level_variances()
    variance = steps[4] * np.sqrt(2) * (1 - 1e-9)
    weights = _mixture(np.array([variance]), steps)[:, 0]
    assert "−0.133, 0.785, 0.348" in FLOW
    assert weights[3:6] == pytest.approx([-0.133, 0.785, 0.348], abs=5e-4)
    assert (weights.sum(), weights @ steps) == pytest.approx((1, variance))

    def errors(mixed, variance=variance):
        every, signed = np.append(steps, variance) / variance, np.append(mixed, -1)
        return np.sqrt(2 * signed @ (1 / (every[:, None] + every)) @ signed), (mixed / steps).sum() * variance - 1

    assert "3.0 % of the kernel" in FLOW
    assert "2.0 % too low" in FLOW
    assert errors(weights) == pytest.approx((0.030, -0.020), abs=5e-4)
    two = np.zeros(LEVELS)
    two[4], two[5] = 2 - np.sqrt(2), np.sqrt(2) - 1
    assert "7.2 %, the middle 12 % too" in FLOW
    assert errors(two) == pytest.approx((0.072, 0.12), abs=2e-3)
    worst = max(errors(_mixture(np.array([v]), steps)[:, 0], v)[0] for v in np.geomspace(1.01, 1.99, 41) * steps[4])
    assert worst < 0.0305


def test_below_level_zero_a_gaussian_passes_to_the_sharp_part_as_stated():
    first = level_variances()[0]
    shares, sharp = _shares(np.array([0.5, 0.8, 0.9, 1.0]) * first)
    assert sharp == pytest.approx([1, 1, 0.5, 0])
    assert shares[0] == pytest.approx([0, 0, 0.5, 1])


def test_bounds_of_a_residual_at_a_centroid_are_those_stated():
    apart = 2 / 3
    assert "at most 1.5 times the prediction is added, and a sixth of it is left" in FLOW
    assert (BRIGHTEST / apart, DARKEST * apart) == pytest.approx((1.5, 1 / 6))


def test_the_energy_of_a_coated_matte_part_is_that_stated():
    c = (np.arange(4000) + 0.5) / 4000
    assert (2 * c * transmitted(c, np)).mean() == pytest.approx(20 / 21, rel=1e-5)
    energy = matte_energy(np.array([np.zeros(3), np.ones(3)]))[:, 0]
    assert energy == pytest.approx(20 / 21 * transmitted(cosines(), np))


@pytest.mark.parametrize("lookups", [2, 3, 24])
def test_spreads_of_lookups_are_those_quoted(lookups):
    quoted = dict(re.findall(r"\\kappa_\{?(\d+)\}? = ([\d.]+)", TEXT))
    assert tap_spreads().numpy()[lookups] == pytest.approx(float(quoted[str(lookups)]), abs=5e-5)


def test_lean_and_width_are_those_quoted():
    assert "0.2° at $\\cos\\theta = 0.52$, 2.5° at 0.19 and 4.4° at 0.05" in FLOW
    assert "0.97, 0.85 and 0.77 of $\\sigma$" in FLOW
    one, nothing = np.ones((1, 3)), Gaussians(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
    bare = Gaussians(np.array([0.1]), one, 0 * one)
    (moments,) = facet_moments(LobeShape(0.1 * np.sqrt(2), bare, nothing, np.zeros((2, 3))))
    at = [int(np.abs(cosines() - cosine).argmin()) for cosine in (0.52, 0.19, 0.05)]
    assert np.degrees(moments.lean[at]) == pytest.approx([0.2, 2.5, 4.4], abs=0.05)
    assert moments.width[at] / 0.1 == pytest.approx([0.97, 0.85, 0.77], abs=5e-3)


def _around(rng, count=40):
    """Viewers, half-vectors, and two tangents of each half-vector; arrays (count, 3)."""
    v, h = (np.column_stack([spread * rng.uniform(-1, 1, (count, 2)), np.ones(count)]) for spread in (0.8, 0.2))
    v, h = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (v, h))
    a = np.cross(h, [0.3, 0.5, 0.8])
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    return v, h, a, np.cross(h, a)


def _stretch(mapped, h, a, b, step):
    """Area that a map of unit vectors makes of an area at `h`, by central differences."""
    around = [[mapped(h + sign * step * t) for sign in (1, -1)] for t in (a, b)]
    da, db = ((after - before) / (2 * step) for after, before in around)
    return np.linalg.norm(np.cross(da, db), axis=1)


def test_the_jacobian_of_equation_12(rng):
    v, h, a, b = _around(rng)

    def light(facet):
        facet = facet / np.linalg.norm(facet, axis=1, keepdims=True)
        return to_numpy(reflected(vector(v), vector(facet), mi.Float(0.3))[0]).T.astype(np.float64)

    stated = 4 * (h * v).sum(axis=1)
    assert _stretch(light, h, a, b, 2e-3) == pytest.approx(stated, rel=2e-3)


def test_a_lookup_shows_the_density_of_equation_21():
    """It integrates to 1, and its mean of 1/(h·v) is that of a Gaussian in the map over the mean of h·v."""
    side = 400
    x, y = (grid.ravel() for grid in np.meshgrid(*[(np.arange(side) + 0.5) * (2 / side) - 1] * 2))
    squared = x**2 + y**2
    inside = squared < 1
    places, squared = np.stack([x, y], axis=1)[inside], squared[inside]
    height, scale = (1 - squared) / (1 + squared), 2 / (1 + squared)
    at = _HalfVectors(np.zeros((len(places), 3)), height, places, (2 / side) ** 2 * scale**2)
    middles, width = np.array([[0.0, 0.0], [0.5, 0.3]]), np.array([0.12, 0.08])
    density = at.solid_angle @ _blobs(middles, width, at)
    assert density == pytest.approx(1, rel=2e-3)
    gaussian = np.exp(-0.5 * ((places[:, None] - middles) ** 2).sum(axis=-1) / width**2) / (2 * np.pi * width**2)
    mean_height = (2 / side) ** 2 * (height @ gaussian)
    inverse = at.solid_angle @ (_blobs(middles, width, at) / height[:, None])
    assert inverse == pytest.approx(1 / mean_height, rel=2e-3)


def test_a_texel_of_the_sphere_map_shows_what_equation_18_and_section_6_say():
    """A step on the disk turns the mirror direction by 2/cos θ of it along the plane of incidence, 2 cos θ across."""
    for radius in (0.1, 0.6, 0.95):
        cosine = np.sqrt(1 - radius**2)

        def mirrored(x, y):
            z = np.sqrt(1 - x * x - y * y)
            return np.array([2 * x * z, 2 * y * z, 2 * z * z - 1])

        step = 1e-6
        along = np.linalg.norm(mirrored(radius + step, 0) - mirrored(radius - step, 0)) / (2 * step)
        across = np.linalg.norm(mirrored(radius, step) - mirrored(radius, -step)) / (2 * step)
        assert (along, across) == pytest.approx((2 / cosine, 2 * cosine), rel=1e-6)
