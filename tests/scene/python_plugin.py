"""A plugin as a user writes it: a module that registers a BSDF when it is imported."""

from __future__ import annotations

from pathlib import Path

SOURCE = """
import drjit as dr
import mitsuba as mi

mi.set_variant("llvm_ad_rgb")  # as in Mitsuba's tutorials


class Chalk(mi.BSDF):
    def __init__(self, props):
        super().__init__(props)
        self.value = props.get("value", 0.5)
        self.m_flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
        self.m_components = [self.m_flags]

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = mi.warp.square_to_cosine_hemisphere(sample2)
        bs.pdf = mi.warp.square_to_cosine_hemisphere_pdf(bs.wo)
        bs.eta = 1.0
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
        return bs, mi.Spectrum(self.value) & (active & (mi.Frame3f.cos_theta(si.wi) > 0))

    def eval(self, ctx, si, wo, active=True):
        lit = (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        return mi.Spectrum(self.value * dr.inv_pi * mi.Frame3f.cos_theta(wo)) & (active & lit)

    def pdf(self, ctx, si, wo, active=True):
        lit = (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        return dr.select(active & lit, mi.warp.square_to_cosine_hemisphere_pdf(wo), 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def to_string(self):
        return f"Chalk[{self.value}]"


mi.register_bsdf("NAME", lambda props: Chalk(props))
"""


def write_plugin(folder: Path, module: str, plugin: str, extra: str = "") -> Path:
    """Write a module that registers a matte BSDF under the name `plugin`, with lines of its own at the end."""
    path = folder / f"{module}.py"
    path.write_text(SOURCE.replace("NAME", plugin) + extra)
    return path
