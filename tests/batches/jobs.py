"""Small jobs, and materials that end their process."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rsibr.batches.job import Job, Then
from rsibr.scene.config import parse_config

PLUGIN = '''
import ctypes
import os
import resource
import sys
import time
from pathlib import Path

import drjit as dr
import mitsuba as mi


class Fatal(mi.BSDF):
    """Half of Lambert's, with a habit. What happens once, happens to the first process that gets here."""

    def __init__(self, properties):
        mi.BSDF.__init__(self, properties)
        self.habit = properties.get("habit", "")
        self.mark = Path(properties.get("mark", "/nowhere"))
        self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    def sample(self, context, si, one, two, active=True):
        drawn = dr.zeros(mi.BSDFSample3f, dr.width(si))
        drawn.wo, drawn.eta = mi.warp.square_to_cosine_hemisphere(two), 1.0
        drawn.sampled_type, drawn.sampled_component = mi.UInt32(+mi.BSDFFlags.DiffuseReflection), 0
        drawn.pdf = self.pdf(context, si, drawn.wo)
        return drawn, mi.Color3f(0.5)

    def eval(self, context, si, wo, active=True):
        self.act()
        return mi.Color3f(0.5 * dr.maximum(wo.z, 0) * dr.inv_pi)

    def pdf(self, context, si, wo, active=True):
        return dr.maximum(wo.z, 0) * dr.inv_pi

    def eval_pdf(self, context, si, wo, active=True):
        return self.eval(context, si, wo), self.pdf(context, si, wo)

    def act(self):
        if self.habit == "segfault":
            ctypes.string_at(0)
        if self.habit == "exit":
            os._exit(7)
        if self.habit == "sys.exit":
            sys.exit("enough")
        if self.habit == "raise":
            raise KeyError("no such thing")
        if self.habit == "full disk":
            try:
                self.mark.touch(exist_ok=False)
            except FileExistsError:
                return
            resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))


mi.register_bsdf("fatal", Fatal)
'''


def job(name: str, sky: Path | str | None, material: Mapping[str, Any] | str = "matte-lambert", **tables: Any) -> Job:
    """Bake of 12 views of 16², 4 samples; of a preset, or of the `fatal` plugin with these properties."""
    then = Then(**tables.pop("then", {}))
    if isinstance(material, str):
        surface: dict[str, Any] = {"material": {"preset": material}}
    else:
        folder = Path(material["folder"])
        (folder / "fatal.py").write_text(PLUGIN)
        own = {key: value for key, value in material.items() if key != "folder"}
        surface = {"material": {"bsdf": {"type": "fatal", **own}}, "plugins": {"modules": [str(folder / "fatal.py")]}}
    light = {"emitter": {"type": "constant", "radiance": 0.5}} if sky is None else {"file": str(sky)}
    small = {"map": {"resolution": 16}, "sampling": {"samples": 4}, "effects": {"view_dependence": "on"}}
    config = parse_config({"environment": light, **surface, **small, **tables}, Path())
    return Job(name, {"material": name}, config.to_dict(), then)


def digests(out: Path) -> dict[str, str]:
    """SHA-256 of every map and light in a batch, by path."""
    return {
        str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(out.rglob("*.exr"))
    }
