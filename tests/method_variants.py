"""What parts of `rsibr` are worth: relMSE with one of them replaced, as a table; `python -m tests.method_variants`.

Twelve maps of 48² with 128 samples, four new views, truth with 512 samples whose noise is taken out.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

import rsibr
from rsibr import backend
from rsibr.geometry.frame import view_frame
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.methods.rsibr.fidelity import FAST
from rsibr.methods.rsibr.residual_transport import warped_residual
from rsibr.scene.config import parse_config
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.store.lobe_shape import shape_of
from rsibr.store.manifest import LobeRecord
from rsibr.validation.flip import exposures_for
from rsibr.validation.metrics import compare
from rsibr.validation.reference import ReferenceRenderer
from rsibr.validation.validation import novel_views

Array = NDArray[np.float64]

RESOLUTION, SAMPLES, TRUTH_SAMPLES, VIEWS = 48, 128, 512, 4
SCENES = (
    ("solid-red", "city"),
    ("rough-aluminium", "city"),
    ("metallic-blue", "courtyard"),
    ("clearcoat-red", "studio"),
    ("glossy-plastic", "studio"),
)
SKIES = Path(__file__).parent.parent / "scenes" / "environments"

_MODULES = "rsibr.methods"


def _of_proxy(record: LobeRecord) -> LobeShape:
    return shape_of(record.model_copy(update={"shape": None}))


def _no_balance(_weights: Any, resolution: int) -> mi.Float:
    return dr.full(mi.Float, 1, 4 * (resolution + 2) ** 2)


def _upright(_angle: Array, lean: Array) -> Array:
    return np.ones_like(lean)


def _two_levels(variance: Array, steps: Array) -> Array:
    """Weights of the two levels around a variance that keep it, as one of three nearest levels; shape (LEVELS, n)."""
    level = np.clip(np.searchsorted(steps, variance) - 1, 0, len(steps) - 2)
    share = (variance - steps[level]) / (steps[level + 1] - steps[level])
    weights = np.zeros((len(steps), len(variance)))
    weights[level, np.arange(len(variance))] = 1 - share
    weights[level + 1, np.arange(len(variance))] = share
    return weights


def _undamped(sources: Any, mixture: Any, warps: Any, n: Any, _damped: bool = True) -> mi.Color3f:
    return warped_residual(sources, mixture, warps, n, damped=False)


def _as_it_is(residual: mi.Color3f, _predicted: mi.Color3f, _mixture: Any) -> mi.Color3f:
    return residual


def _in_full(_trust: mi.Float, _mixture: Any) -> mi.Float:
    return mi.Float(1)


VARIANTS: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "`cabral1999`": ("cabral1999", {}, {}),
    "**`rsibr`**": ("rsibr", {}, {}),
    "$P$ alone, no residuals": ("rsibr", {}, {"uses_maps": False}),
    "shapes of the proxies, not of the lobes": ("rsibr", {"inputs.shape_of": _of_proxy}, {}),
    "$\\beta = 1$ (no balance)": ("rsibr", {"rsibr.half_vector_lobes.balance": _no_balance}, {}),
    "$\\phi_\\ell = 1$ (no lean)": ("rsibr", {"rsibr.lobe_weights._radius_factors": _upright}, {}),
    "two levels mixed, not three": ("rsibr", {"rsibr.lobe_weights._mixture": _two_levels}, {}),
    "$G = 192$": ("rsibr", {"rsibr.rsibr.FAST": replace(FAST, resolution=192)}, {}),
    "320 points of the quadrature": ("rsibr", {"rsibr.rsibr.FAST": replace(FAST, points=320)}, {}),
    "one point a texel at the rim": ("rsibr", {"rsibr.half_vector_lobes._FINE_MAP": 1}, {}),
    "$\\rho_i = 1$": ("rsibr", {"rsibr.residual_method.warped_residual": _undamped}, {}),
    "$\\gamma = 1$ (full trust)": ("rsibr", {"rsibr.residual_method.trusted": _in_full}, {}),
    "no clamp": ("rsibr", {"rsibr.residual_method.clamped": _as_it_is}, {}),
    "**`rsibr-fine`**": ("rsibr-fine", {}, {}),
    "$P$ alone": ("rsibr-fine", {}, {"uses_maps": False}),
}
"""For each row the method, what is replaced in its modules, and its options."""


@contextmanager
def replaced(values: dict[str, Any]) -> Iterator[None]:
    """Replace functions and constants of the method's modules."""
    with ExitStack() as stack:
        for name, value in values.items():
            stack.enter_context(patch(f"{_MODULES}.{name}", value))
        yield


def main() -> None:
    """Print the table."""
    backend.use()
    columns = [_errors(*scene) for scene in SCENES]
    print("| change | " + " | ".join(f"{material}, {sky}" for material, sky in SCENES) + " |")  # noqa: T201
    print("|---|" + "---|" * len(SCENES))  # noqa: T201
    for row in VARIANTS:
        print(f"| {row} | " + " | ".join(f"{1e3 * column[row]:.3g}" for column in columns) + " |")  # noqa: T201


def _errors(material: str, sky: str) -> dict[str, float]:
    """Mean relMSE of each variant over the new views."""
    config = parse_config(
        {
            "environment": {"file": str(SKIES / f"{sky}.exr")},
            "material": {"preset": material},
            "map": {"resolution": RESOLUTION},
            "sampling": {"samples": SAMPLES},
        },
        Path(),
    )
    renderer = ReferenceRenderer(load_environment(config.environment), load_material(config.material), RESOLUTION)
    with tempfile.TemporaryDirectory() as folder:
        bake = rsibr.bake(config, out=Path(folder) / "bake.rsibr")
        views = [view for _, view in novel_views(bake, VIEWS)]
        truths = [renderer.render(view_frame(view), TRUTH_SAMPLES, seed=7) for view in views]
        judged = partial(_error, views, truths)
        found = {}
        for row, (method, values, options) in VARIANTS.items():
            with replaced(values):
                made = MethodSet(bake).variant(method, **options)
                found[row] = judged(lambda view, made=made: run(made, view_frame(view), RESOLUTION).image)
        return found


def _error(views: list[Array], truths: list[Any], image: Callable[[Array], NDArray[np.float32]]) -> float:
    """Mean relMSE of maps of some views, debiased."""
    errors = []
    for view, truth in zip(views, truths, strict=True):
        exposures = exposures_for(float(truth.mean[truth.coverage > 0].mean()))
        errors.append(compare(image(view), truth, exposures, "").rel_mse.value)
    return float(np.mean(errors))


if __name__ == "__main__":
    main()
