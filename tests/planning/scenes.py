"""Materials and skies with known properties, and the plan of a pair of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rsibr.baking.pilot import sampling_ratio
from rsibr.planning.maps import left_out_errors
from rsibr.planning.plan import Plan
from rsibr.planning.planner import Probes, make_plan, probe_scene
from rsibr.scene.config import Config, EffectsConfig, EnvironmentConfig, MapConfig, MaterialConfig, SamplingConfig
from rsibr.scene.environment import Environment
from rsibr.scene.mitsuba_bsdf import load_bsdf
from tests.scene.maps import latlong_directions

DIFFUSE = {"type": "diffuse", "reflectance": 0.5}
RED = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.8, 0.2, 0.1]}}
MIRROR = {"type": "conductor", "material": "none"}
METAL = {"type": "roughconductor", "material": "none", "alpha": 0.1, "distribution": "ggx"}
BRUSHED = {"type": "roughconductor", "material": "none", "alpha_u": 0.05, "alpha_v": 0.3, "distribution": "ggx"}
PLASTIC = {"type": "roughplastic", "alpha": 0.05, "distribution": "ggx", "diffuse_reflectance": 0.4}
RETRO = {"type": "rsibr_car_paint", "retro_share": 0.5}

UP = np.array([0.0, 1.0, 0.0])


def sky(function: Any, height: int = 129, width: int = 256) -> Environment:
    """Environment whose radiance is a function of the world direction; one value, or one a channel."""
    values = np.asarray(function(latlong_directions(height, width)), dtype=np.float32)
    image = np.repeat(values[..., None], 3, axis=2) if values.ndim == 2 else values
    return Environment("sky", "", np.ascontiguousarray(image), 0, 0.0, {"type": "envmap"})


def constant(radiance: float = 0.5) -> Environment:
    return Environment("constant", "", None, 0, 0.0, {"type": "constant", "radiance": radiance})


def gradient(slope: float = 0.6) -> Environment:
    """L(ω) = 1 + a·ω, grey."""
    return sky(lambda d: 1 + slope * (d @ UP))


def sun() -> Environment:
    """A source of 1e4 in a few texels over a sky of 1."""
    return sky(lambda d: 1 + 1e4 * (d @ np.array([0.6, 0.8, 0.0]) > 0.9995))


def coloured() -> Environment:
    return sky(lambda d: 1 + 0.6 * np.stack([d[..., 0], d[..., 1], d[..., 2]], axis=-1))


@dataclass(frozen=True)
class Planned:
    """A plan, and what it goes by."""

    plan: Plan
    probes: Probes

    @property
    def left_out(self) -> list[float]:
        """What leaving each lobe out would make."""
        return left_out_errors(self.probes.split.lobes, self.probes.material.lobes, self.probes.light)


def planned(
    bsdf: dict[str, Any], light: Environment, side: int | None = 64, clamp: float | None = None, **effects: str
) -> Planned:
    """Plan a scene; without a `side` the config leaves it at its default."""
    config = Config(
        environment=EnvironmentConfig(emitter={"type": "constant"}),
        material=MaterialConfig(bsdf=bsdf),
        map=MapConfig() if side is None else MapConfig(resolution=side),
        sampling=SamplingConfig(samples=64, clamp=clamp),
        effects=EffectsConfig(**effects),
    )
    loaded = load_bsdf(bsdf, "the test")
    probes = probe_scene(light, loaded)
    ratio = sampling_ratio(light.emitter(), loaded, 16) if probes.wants_pilot else None
    return Planned(make_plan(config, probes, ratio), probes)
