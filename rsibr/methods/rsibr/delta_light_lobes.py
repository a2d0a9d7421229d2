"""Reflection of delta lights by the lobes of a material, in closed form: irradiance times the fitted BRDF.

A light without extent is in no image of the environment. Its part of the prediction P is the sum of the proxy lobes
(`rsibr.lobes.basis`) at its direction, each times its ratio to the lobe itself (`rsibr.lobes.proxy_ratio`). A delta
lobe does not reflect it: two delta distributions never meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device
from rsibr.light.delta_lights_on_device import DeltaLightsOnDevice
from rsibr.light.radiance import Light
from rsibr.lobes.basis import LAMBERT, coated_ggx, ggx, lambert
from rsibr.lobes.proxy_ratio import NODES, glossy_place, matte_place
from rsibr.methods.rsibr.anisotropic_footprint import ShadingFrame
from rsibr.methods.texel_mean import texel_mean
from rsibr.store.manifest import LobeRecord

_DENSITY = 4.0  # sample points of a texel over its width in widths of the highlight there
_FEWEST, _MOST = 2, 64  # sample points a side of a texel
_FLATTEST = 0.1  # cosine below which the number of points does not grow further
_COLOURS = 3  # coefficients of a term: plain, grazing, coated
_WIDEST = 1.0  # width of a reflection without a highlight


@dataclass(eq=False)
class ProxyTerms:
    """Proxy of one lobe and its ratio to the lobe itself.

    Attributes
    ----------
    terms : mi.Float
        Roughness of each glossy term, then its plain, grazing and coated colour, four packets of four floats, flat.
    count : mi.UInt32
        Number of terms (opaque).
    bare, coated : mi.Color3f
        Coefficients of the two cosine lobes (opaque).
    ratio : mi.Float
        Table of `rsibr.lobes.proxy_ratio`, RGB0, row-major, flat.
    alpha : mi.Float
        Roughness α of the lobe (opaque).
    is_matte : bool
        Whether the table is that of a matte lobe.
    """

    terms: mi.Float
    count: mi.UInt32
    bare: mi.Color3f
    coated: mi.Color3f
    ratio: mi.Float
    alpha: mi.Float
    is_matte: bool

    @classmethod
    def of(cls, lobe: LobeRecord, ratio: NDArray[np.float32] | None) -> ProxyTerms:
        """Put the proxy of a lobe on the device; without a table the ratio is 1."""
        matte, terms = np.zeros((2, 3)), list[NDArray[np.float64]]()
        for proxy in lobe.proxies:
            colours = np.array(proxy.coefficients, dtype=np.float64)
            if proxy.alpha == LAMBERT:
                matte[: len(colours)] += colours
            elif colours.any():
                padded = np.zeros((1 + _COLOURS, 4))
                padded[0, 0], padded[1 : 1 + len(colours), :3] = proxy.alpha, colours
                terms.append(padded.ravel())
        bare, coated = (mi.Color3f(*colour) for colour in matte.tolist())
        dr.make_opaque(bare, coated)
        rows = np.array(terms or [np.zeros(4 * (1 + _COLOURS))], dtype=np.float32)  # kernels cannot take empty arrays
        table = np.pad(np.ones((NODES, NODES, 3), np.float32) if ratio is None else ratio, ((0, 0), (0, 0), (0, 1)))
        return cls(
            to_device(mi.Float, rows),
            dr.opaque(mi.UInt32, len(terms)),
            bare,
            coated,
            to_device(mi.Float, table),
            dr.opaque(mi.Float, max(lobe.alpha, 0.0)),
            lobe.alpha == LAMBERT,
        )

    def brdf_cosine(self, wi: mi.Vector3f, wo: mi.Vector3f) -> mi.Color3f:
        """BRDF times cosine of the light [sr⁻¹] for unit directions in the surface's frame; docs/method.md, eq. 8."""
        bare, under_coat = lambert(wi, wo)

        def add(k: mi.UInt32, total: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f]:
            alpha, *colours = (dr.gather(mi.Vector4f, self.terms, (1 + _COLOURS) * k + row) for row in range(4))
            values = *ggx(wi, wo, alpha.x), coated_ggx(wi, wo, alpha.x)
            for value, colour in zip(values, colours, strict=True):
                total += value * mi.Color3f(colour.x, colour.y, colour.z)
            return k + 1, total

        _, total = dr.while_loop(
            state=(mi.UInt32(0), bare * self.bare + under_coat * self.coated),
            cond=lambda k, _total: k < self.count,
            body=add,
            labels=("k", "total"),
            label="proxy_terms",
        )
        return total * self._ratio_at(matte_place(wi, wo) if self.is_matte else glossy_place(wi, wo, self.alpha))

    def _ratio_at(self, place: mi.Point2f) -> mi.Color3f:
        """Ratio of the lobe to its proxy, bilinear."""
        x, y = place.x * (NODES - 1), place.y * (NODES - 1)
        left, top = (dr.minimum(mi.UInt32(at), NODES - 2) for at in (x, y))

        def node(offset: int) -> mi.Vector4f:
            return dr.gather(mi.Vector4f, self.ratio, top * NODES + left + offset)

        upper, lower = (dr.lerp(node(first), node(first + 1), x - mi.Float(left)) for first in (0, NODES))
        ratio = dr.lerp(upper, lower, y - mi.Float(top))
        return mi.Color3f(ratio.x, ratio.y, ratio.z)


@dataclass(eq=False)
class DeltaLightLobes:
    """Delta lights and the lobes that reflect them; docs/method.md, section 6.4.

    Attributes
    ----------
    lights : DeltaLightsOnDevice
        Delta lights.
    lobes : list of ProxyTerms
        Lobes that are not delta lobes.
    width : mi.Float
        Least roughness of a term, the width of the narrowest highlight (opaque).
    """

    lights: DeltaLightsOnDevice
    lobes: list[ProxyTerms]
    width: mi.Float

    @classmethod
    def of(cls, light: Light, lobes: Sequence[LobeRecord]) -> DeltaLightLobes | None:
        """Put the delta lights of a bake and its lobes on the device; None if there are no such lights."""
        if light.delta.is_black:
            return None
        roughness = [proxy.alpha for lobe in lobes for proxy in lobe.proxies if proxy.alpha != LAMBERT]
        return cls(
            DeltaLightsOnDevice.of(light.delta),
            [ProxyTerms.of(lobe, light.proxy_ratios.get(lobe.name)) for lobe in lobes if lobe.proxies],
            dr.opaque(mi.Float, min(roughness, default=_WIDEST)),
        )

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance [W sr⁻¹ m⁻²] toward `v` from surfaces with normal `n`, unit vectors in world coordinates."""
        shading = ShadingFrame.of(n, v)

        def add(k: mi.UInt32, total: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f]:
            d, irradiance = self.lights.at(k)
            wi = mi.Vector3f(dr.dot(shading.x, d), dr.dot(shading.y, d), dr.dot(shading.n, d))
            reflected = mi.Color3f(0)
            for lobe in self.lobes:
                reflected += lobe.brdf_cosine(wi, shading.v)
            return k + 1, total + dr.select(wi.z > 0, reflected * irradiance, 0)

        _, total = dr.while_loop(
            state=(mi.UInt32(0), dr.zeros(mi.Color3f, dr.width(n))),
            cond=lambda k, _total: k < self.lights.count,
            body=add,
            labels=("k", "total"),
            label="delta_lights",
        )
        return total

    def mean_over_texel(self, n: mi.Vector3f, frame: mi.Matrix3f, spacing: mi.Float) -> mi.Color3f:
        """Mean radiance over the part of a texel inside the disk.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normal of any point of each texel, in the map's frame.
        frame : mi.Matrix3f
            Columns x, y, v of the map's frame.
        spacing : mi.Float
            Distance of neighbouring texels in radii of the disk.

        Returns
        -------
        mi.Color3f
            [W sr⁻¹ m⁻²].
        """
        v = mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2])
        side = self._points(frame @ n, v, n.z, spacing)
        return texel_mean(
            n, spacing, (side, side), lambda normal: self.radiance(frame @ normal, v), "delta_lights_over_texel"
        )

    def _points(self, n: mi.Vector3f, v: mi.Vector3f, cosine: mi.Float, spacing: mi.Float) -> mi.UInt32:
        """Sample points a side of a texel: in proportion to its normals' spread over the width of the highlight.

        A GGX highlight of roughness α is about √(α² + d²) wide at the distance d from its centre, the half vector of
        light and viewer. d is that of the texel's nearest point.
        """
        spread = spacing / dr.maximum(cosine, _FLATTEST)

        def nearer(k: mi.UInt32, least: mi.Float) -> tuple[mi.UInt32, mi.Float]:
            half = self.lights.at(k)[0] + v
            away = dr.norm(n - half * dr.rsqrt(dr.maximum(dr.squared_norm(half), 1e-12)))
            return k + 1, dr.minimum(least, away)

        _, away = dr.while_loop(
            state=(mi.UInt32(0), dr.full(mi.Float, 2, dr.width(n))),
            cond=lambda k, _least: k < self.lights.count,
            body=nearer,
            labels=("k", "least"),
            label="nearest_highlight",
        )
        away = dr.maximum(away - spread, 0)
        width = dr.sqrt(self.width * self.width + away * away)
        return mi.UInt32(dr.clip(dr.ceil(_DENSITY * spread / width), _FEWEST, _MOST))
