"""docs/method.md: what it refers to exists, and the numbers and identities that it states are those of the code."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.facet_moments import cosines, facet_moments
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.methods.rsibr.anisotropic_footprint import ShadingFrame, tap_spreads
from rsibr.methods.rsibr.half_vector_pyramid import (
    LEVELS,
    _offsets,
    _stored,
    _summed,
    _taps,
    finest_resolution,
    level_variances,
    texel_angle,
)
from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from rsibr.methods.rsibr.lobe_weights import _shares
from tests.arrays import to_numpy, vector
from tests.methods.rsibr.test_half_vector_pyramid import weights

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "docs" / "method.md").read_text()
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


def test_the_table_of_levels_is_that_of_the_code():
    rows = np.array(re.findall(r"\| (\d) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|", TEXT), dtype=float)
    assert rows[:, 0].tolist() == list(range(LEVELS))
    assert rows[:, 1] == pytest.approx(level_variances(), abs=5e-5)
    assert rows[:, 2] == pytest.approx(np.sqrt(level_variances()), abs=5e-5)
    assert finest_resolution(64) == 80
    assert rows[:, 3] == pytest.approx(np.sqrt(level_variances()) * texel_angle(80, np.array(0.0)), abs=5e-5)


def test_the_kernel_between_levels_has_the_taps_and_the_variance_stated():
    assert "0.0882, 0.1719, 0.2399" in TEXT
    assert _taps()[:3] == pytest.approx([0.0882, 0.1719, 0.2399], abs=5e-5)
    assert r"\tau = \sum_x k(x)\,x^2 = 1.9965" in TEXT
    assert (_taps() * _offsets() ** 2).sum() == pytest.approx(1.9965, abs=5e-5)


@pytest.mark.parametrize("level", range(LEVELS))
def test_the_collapse_widens_a_level_as_equation_25_says(level):
    """A parabola comes back with the variance added, whatever the kernel's shape is; the lookups at both ends aside."""
    g = 256
    column = (np.arange(g + 2) - (g + 1) / 2) / g
    x = np.tile(column, g + 2)
    texels = np.stack([x**2, x**2, x**2, np.ones_like(x)], axis=1).astype(np.float32)
    found = to_numpy(_summed(_stored(mi.Vector4f(texels.T)), weights(np.arange(LEVELS) == level), g))[0]
    middle = (np.abs(x) < 0.1) & (np.abs(np.repeat(column, g + 2)) < 0.1)
    added = (found - x**2)[middle].mean() * g**2
    tau = (_taps() * _offsets() ** 2).sum()
    stated = tau * (4**level - 1) / 3 + (4**level - 1) / 4
    assert added == pytest.approx(stated, rel=1e-3, abs=1e-3)
    excess = (0.25 + stated + 1 / 6) / level_variances()[level] - 1
    assert {0: 0.0, 1: 0.086, 4: 0.1}.get(level, excess) == pytest.approx(excess, abs=5e-4)


@pytest.mark.parametrize("lookups", [2, 3, 24])
def test_spreads_of_lookups_are_those_quoted(lookups):
    quoted = dict(re.findall(r"\\kappa_\{?(\d+)\}? = ([\d.]+)", TEXT))
    assert tap_spreads().numpy()[lookups] == pytest.approx(float(quoted[str(lookups)]), abs=5e-5)


def test_below_level_zero_the_mixture_is_too_wide_by_the_factor_stated():
    first = level_variances()[0]
    variance = np.linspace(0.01, 0.99, 20) * first
    shares = _shares(variance)
    assert shares[0] * first + shares[-1] * variance == pytest.approx(variance * (2 - variance / first))


def test_lean_and_width_are_those_quoted():
    assert "0.2° at $\\cos\\theta = 0.52$, 2.5° at 0.19 and 4.4° at 0.05" in TEXT
    assert "0.97, 0.85 and 0.77 of $\\sigma$" in TEXT
    one, nothing = np.ones((1, 3)), Gaussians(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
    bare = Gaussians(np.array([0.1]), one, 0 * one)
    (moments,) = facet_moments(LobeShape(0.1 * np.sqrt(2), bare, nothing, np.zeros((2, 3))))
    at = [int(np.abs(cosines() - cosine).argmin()) for cosine in (0.52, 0.19, 0.05)]
    assert np.degrees(moments.lean[at]) == pytest.approx([0.2, 2.5, 4.4], abs=0.05)
    assert moments.width[at] / 0.1 == pytest.approx([0.97, 0.85, 0.77], abs=5e-3)


def _integral():
    """A lobe's reflection integral; of its light nothing is asked."""
    gaussians = Gaussians(np.array([0.3]), np.ones((1, 3)), np.zeros((1, 3)))
    picture = np.ones((8, 8, 3), np.float32)
    shape = LobeShape(0.4, gaussians, gaussians, np.zeros((2, 3)))
    return LobeIntegral.of(shape, EnvironmentPyramid.of(picture), Light(picture))


@pytest.mark.parametrize("kind", ["bare", "coated"])
def test_the_jacobians_of_equations_12_and_21(kind, rng):
    """dω_i = 4 (h·v) dω_h, under a coat times η² cos θ_i'/cos θ_i: what the code states, by central differences."""
    count, step = 40, 2e-3
    v, h = (np.column_stack([spread * rng.uniform(-1, 1, (count, 2)), np.ones(count)]) for spread in (0.8, 0.2))
    v, h = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (v, h))
    a = np.cross(h, [0.3, 0.5, 0.8])
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    shading = ShadingFrame.of(mi.Vector3f(0, 0, 1), vector(v))
    reflect = getattr(_integral(), f"_{kind}")

    def into(facet):
        """Directions of the light in world coordinates, for half-vectors in world coordinates."""
        facet = vector(facet / np.linalg.norm(facet, axis=1, keepdims=True))
        local = mi.Vector3f(*(dr.dot(axis, facet) for axis in (shading.x, shading.y, shading.n)))
        w, _, _, stretch = reflect(shading, local)
        return to_numpy(shading.to_world(w)).T.astype(np.float64), to_numpy(stretch).astype(np.float64)

    da, db = ((into(h + step * t)[0] - into(h - step * t)[0]) / (2 * step) for t in (a, np.cross(h, a)))
    light, stated = into(h)
    above = light[:, 2] > 0.3
    assert above.sum() > 20
    assert np.linalg.norm(np.cross(da, db), axis=1)[above] == pytest.approx(stated[above], rel=2e-3)


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
