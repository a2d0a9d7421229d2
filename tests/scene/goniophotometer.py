"""A virtual goniophotometer: Mitsuba path-traces a sample that lies in the open, and reads what it reflects.

The sample is either a flat piece of one material, or *real layers*: a dielectric interface, an absorbing medium, and a
substrate below it. The layers share no code with `rsibr.scene.paint.car_paint`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

SIZE = 1e4
"""Half the width of a sample, in thicknesses of the coat: nothing leaves at the sides."""

PIXELS = 16
"""Pixels a side; all see the same, so their spread is the noise."""


@dataclass(frozen=True)
class Reading:
    """Radiance that the sample sends to the instrument, a channel each, and its standard error."""

    value: np.ndarray
    error: np.ndarray


def flat(bsdf: dict[str, Any]) -> dict[str, Any]:
    """Return a sample of one material."""
    return {"surface": _plane(0.0, bsdf)}


def layers(substrate: dict[str, Any], eta: float = 1.5, depth: float = 0.0, coat_alpha: float = 0.0) -> dict[str, Any]:
    """Return a sample of a dielectric interface over a substrate, with a medium of optical depth `depth` between."""
    kind = (
        {"type": "roughdielectric", "alpha": coat_alpha, "distribution": "ggx"}
        if coat_alpha
        else {"type": "dielectric"}
    )
    coat = _plane(0.0, {**kind, "int_ior": eta, "ext_ior": 1.0})
    if depth > 0:
        coat["interior"] = {"type": "homogeneous", "sigma_t": depth, "albedo": 0.0}
    return {"coat": coat, "substrate": _plane(-1.0, substrate)}


def sky(axes: list[list[float]], sharpness: float) -> dict[str, Any]:
    """Return a sky with a soft light exp(κ (ω·a − 1)) in each of three directions, one a channel."""
    height = 512
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(2 * height) + 0.5) / (2 * height), indexing="ij")
    polar, turn = np.pi * v, 2 * np.pi * u
    directions = np.stack([np.sin(turn) * np.sin(polar), np.cos(polar), -np.cos(turn) * np.sin(polar)], axis=-1)
    image = np.exp(sharpness * (directions @ np.transpose(axes) - 1))
    return {"type": "envmap", "bitmap": mi.Bitmap(image.astype(np.float32)), "scale": 1.0}


def measure(sample: dict[str, Any], light: dict[str, Any], polar: float, samples: int, seed: int) -> Reading:
    """Look at the sample from `polar` [rad] off its normal (+Y), toward +X; `samples` paths in all."""
    toward = np.array([np.sin(polar), np.cos(polar), 0.0])
    look = mi.ScalarTransform4f().look_at(origin=(10 * toward).tolist(), target=[0, 0, 0], up=[0, 0, 1])
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": 200, "rr_depth": 200},
            "sensor": {
                "type": "orthographic",
                "to_world": look @ mi.ScalarTransform4f().scale([1e-3, 1e-3, 1]),
                "film": {
                    "type": "hdrfilm",
                    "width": PIXELS,
                    "height": PIXELS,
                    "pixel_format": "rgb",
                    "component_format": "float32",
                    "rfilter": {"type": "box"},
                },
                "sampler": {"type": "independent"},
            },
            "light": light,
            **sample,
        }
    )
    image = np.array(mi.render(scene, spp=samples // PIXELS**2, seed=seed), dtype=np.float64).reshape(-1, 3)
    return Reading(image.mean(axis=0), image.std(axis=0, ddof=1) / PIXELS)


def _plane(height: float, bsdf: dict[str, Any]) -> dict[str, Any]:
    place = mi.ScalarTransform4f().translate([0, height, 0]).rotate([1, 0, 0], -90).scale(SIZE)
    return {"type": "rectangle", "to_world": place, "bsdf": bsdf}
