"""Light of the narrow Gaussians of all lobes, each gathered over its own footprint; docs/method.md, section 6.1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr.geometry.to_device import to_device
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.lobes.facet_moments import NODES
from rsibr.methods.rsibr.anisotropic_footprint import AnisotropicFootprint, ShadingFrame, tap_spreads
from rsibr.methods.rsibr.lobe_terms import GaussianTerm
from rsibr.methods.rsibr.microfacet_reflection import reflected

_PACKETS = 3  # a Gaussian: (α, is coated, 0, 0), plain weight, grazing weight


@dataclass(eq=False)
class NarrowGaussians:
    """Narrow Gaussians on the device.

    Attributes
    ----------
    rows : mi.Float
        Three packets of four floats a Gaussian: (α of the masking, 1 if coated, 0, 0), plain RGB0, grazing RGB0.
    seen : mi.Float
        For each Gaussian and each of `NODES` angles even in √cos θ two packets: share of the albedo (RGB) and standard
        deviation, then the tilt of its centre.
    count : mi.UInt32
        Number of Gaussians (opaque).
    spreads : mi.Float
        From `rsibr.methods.rsibr.anisotropic_footprint.tap_spreads`.
    """

    rows: mi.Float
    seen: mi.Float
    count: mi.UInt32
    spreads: mi.Float

    @classmethod
    def of(cls, terms: Sequence[GaussianTerm], parts: Sequence[GaussianTerm]) -> NarrowGaussians | None:
        """Put the narrow ones of `terms` on the device; see `WideLight.of`. None if there are none."""
        members = [(term, part) for term, part in zip(terms, parts, strict=True) if not term.is_wide]
        if not members:
            return None
        rows = np.zeros((len(members), _PACKETS, 4))
        seen = np.zeros((len(members), NODES, 2, 4))
        for k, (term, part) in enumerate(members):
            rows[k, 0, :2] = term.alpha, term.is_coated
            rows[k, 1, :3], rows[k, 2, :3] = term.plain, term.grazing
            seen[k, :, 0, :3], seen[k, :, 0, 3] = part.share, term.sigma
            if term.is_coated:  # masking and refraction enter by the moments, not along the footprint
                seen[k, :, 0, 3], seen[k, :, 1, 0] = term.moments.width, np.tan(term.moments.lean)
        return cls(
            to_device(mi.Float, rows.astype(np.float32)),
            to_device(mi.Float, seen.astype(np.float32)),
            dr.opaque(mi.UInt32, len(members)),
            tap_spreads(),
        )

    def radiance(self, shading: ShadingFrame, spacing: mi.Float, environment: EnvironmentPyramid) -> mi.Color3f:
        """Reflected radiance [W sr⁻¹ m⁻²]; `spacing` as in `AnisotropicFootprint.of`."""
        place = dr.sqrt(shading.cosine) * (NODES - 1)
        node = dr.minimum(mi.UInt32(place), NODES - 2)
        between = place - mi.Float(node)

        def gather(i: mi.UInt32, total: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f]:
            masking, plain, grazing = (dr.gather(mi.Vector4f, self.rows, _PACKETS * i + k) for k in range(_PACKETS))
            seen, tilt = (self._at(i, node, between, packet) for packet in range(2))
            weights, grazed_weights = _rgb(plain), _rgb(grazing)
            is_coated = masking.y > 0

            def colour(facet: mi.Vector3f) -> tuple[mi.Vector3f, mi.Color3f]:
                w, factor, grazed = reflected(shading.v, facet, masking.x)
                factor = dr.select(is_coated & (factor > 0), dr.dot(facet, shading.v), factor)
                return w, factor * (weights + grazed_weights * grazed)

            footprint = AnisotropicFootprint.of(shading, seen.w, spacing, tilt.x)
            light, weight = footprint.gather(self.spreads, colour, environment.blurred)
            return i + 1, total + _rgb(seen) * light / dr.maximum(weight, 1e-20)

        _, total = dr.while_loop(
            state=(mi.UInt32(0), dr.zeros(mi.Color3f, 1)),
            cond=lambda i, _total: i < self.count,
            body=gather,
            labels=("i", "total"),
            label="narrow_gaussians",
        )
        return total

    def _at(self, gaussian: mi.UInt32, node: mi.UInt32, between: mi.Float, packet: int) -> mi.Vector4f:
        first = 2 * (gaussian * NODES + node) + packet
        return dr.lerp(dr.gather(mi.Vector4f, self.seen, first), dr.gather(mi.Vector4f, self.seen, first + 2), between)


def _rgb(values: mi.Vector4f) -> mi.Color3f:
    return mi.Color3f(values.x, values.y, values.z)
