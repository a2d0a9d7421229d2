"""Light of narrow Gaussians, each gathered over its own footprint; docs/method.md, section 6.1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device
from rsibr.lobes.facet_moments import NODES
from rsibr.methods.lobe_terms import GaussianTerm
from rsibr.methods.rsibr.anisotropic_footprint import AnisotropicFootprint, LookUp, ShadingFrame, tap_spreads
from rsibr.methods.rsibr.microfacet_reflection import reflected

Array = NDArray[np.float64]

_PACKETS = 3  # a footprint: (α, is coated, 0, 0), plain weight, grazing weight


@dataclass(frozen=True, eq=False)
class FootprintTables:
    """Footprints on the host.

    Attributes
    ----------
    rows : ndarray, shape (footprints, 3, 4)
        (α of the masking, 1 if coated, 0, 0), plain RGB0, grazing RGB0.
    seen : ndarray, shape (footprints, NODES, 2, 4)
        At each of `NODES` angles even in √cos θ share of the albedo (RGB) and standard deviation, then the tilt of the
        centre.
    is_single : bool
        Whether there is one footprint for all.
    """

    rows: Array
    seen: Array
    is_single: bool

    @classmethod
    def of(
        cls,
        terms: Sequence[GaussianTerm],
        parts: Sequence[GaussianTerm],
        fractions: Array | None = None,
        *,
        ratio: float,
    ) -> FootprintTables | None:
        """Put narrow Gaussians together; parameters and result as of `NarrowGaussians.of`."""
        kept = np.ones((len(terms), NODES)) if fractions is None else fractions
        groups = _groups(terms, [k for k in range(len(terms)) if kept[k].any()], ratio)
        if not groups:
            return None
        rows, seen = np.zeros((len(groups), _PACKETS, 4)), np.zeros((len(groups), NODES, 2, 4))
        for row, angles, members in zip(rows, seen, groups, strict=True):
            _fill(row, angles, [(terms[k], parts[k], kept[k]) for k in members])
        return cls(rows, seen, bool(np.isinf(ratio)))


@dataclass(eq=False)
class NarrowGaussians:
    """Footprints on the device, each of a few Gaussians of similar width.

    Attributes
    ----------
    rows : mi.Float
        Three packets of four floats a footprint: (α of the masking, 1 if coated, 0, 0), plain RGB0, grazing RGB0.
    seen : mi.Float
        For each footprint and each of `NODES` angles even in √cos θ two packets: share of the albedo (RGB) and standard
        deviation, then the tilt of its centre.
    count : mi.UInt32
        Number of footprints (opaque).
    spreads : mi.Float
        From `rsibr.methods.rsibr.anisotropic_footprint.tap_spreads`.
    is_single : bool
        Whether there is one footprint for all, so narrow that masking does not vary over it.
    """

    rows: mi.Float
    seen: mi.Float
    count: mi.UInt32
    spreads: mi.Float
    is_single: bool

    @classmethod
    def of(
        cls,
        terms: Sequence[GaussianTerm],
        parts: Sequence[GaussianTerm],
        fractions: Array | None = None,
        *,
        ratio: float,
    ) -> NarrowGaussians | None:
        """Put narrow Gaussians on the device.

        Parameters
        ----------
        terms, parts : sequence of GaussianTerm
            Gaussians of all lobes, and the same in the same order with the shares that count: of all lobes, or of one.
        fractions : ndarray, shape (terms, NODES), optional
            Fraction of each that is gathered, by angle; by default all.
        ratio : float
            Greatest ratio of the widths that share a footprint; if it is infinite, all do.

        Returns
        -------
        NarrowGaussians or None
            None if there is nothing to gather.
        """
        tables = FootprintTables.of(terms, parts, fractions, ratio=ratio)
        return None if tables is None else cls.from_tables(tables)

    @classmethod
    def from_tables(cls, tables: FootprintTables) -> NarrowGaussians:
        """Put footprints on the device."""
        return cls(
            to_device(mi.Float, tables.rows.astype(np.float32)),
            to_device(mi.Float, tables.seen.astype(np.float32)),
            dr.opaque(mi.UInt32, len(tables.rows)),
            tap_spreads(),
            is_single=tables.is_single,
        )

    def radiance(self, shading: ShadingFrame, spacing: mi.Float, look_up: LookUp) -> mi.Color3f:
        """Reflected radiance [W sr⁻¹ m⁻²]; `spacing` as in `AnisotropicFootprint.of`."""
        place = dr.sqrt(shading.cosine) * (NODES - 1)
        node = dr.minimum(mi.UInt32(place), NODES - 2)
        between = place - mi.Float(node)

        if self.is_single:
            seen = self._at(mi.UInt32(0), node, between, 0)
            return _rgb(seen) * AnisotropicFootprint.of(shading, seen.w, spacing).three_taps(look_up)

        def gather(i: mi.UInt32, total: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f]:
            masking, plain, grazing = (dr.gather(mi.Vector4f, self.rows, _PACKETS * i + k) for k in range(_PACKETS))
            seen, tilt = (self._at(i, node, between, packet) for packet in range(2))
            weights, grazed_weights = _rgb(plain), _rgb(grazing)

            def colour(facet: mi.Vector3f) -> tuple[mi.Vector3f, mi.Color3f]:
                w, factor, grazed = reflected(shading.v, facet, masking.x)
                factor = dr.select((masking.y > 0) & (factor > 0), dr.dot(facet, shading.v), factor)
                return w, factor * (weights + grazed_weights * grazed)

            footprint = AnisotropicFootprint.of(shading, seen.w, spacing, tilt.x)
            light, weight = footprint.gather(self.spreads, colour, look_up)
            return i + 1, total + _rgb(seen) * light / dr.maximum(weight, 1e-20)

        _, total = dr.while_loop(
            state=(mi.UInt32(0), dr.zeros(mi.Color3f, 1)),
            cond=lambda i, _total: i < self.count,
            body=gather,
            labels=("i", "total"),
            label="narrow_gaussians",
        )
        return total

    def _at(self, row: mi.UInt32, node: mi.UInt32, between: mi.Float, packet: int) -> mi.Vector4f:
        first = 2 * (row * NODES + node) + packet
        return dr.lerp(dr.gather(mi.Vector4f, self.seen, first), dr.gather(mi.Vector4f, self.seen, first + 2), between)


def _groups(terms: Sequence[GaussianTerm], members: list[int], ratio: float) -> list[list[int]]:
    """Indices of Gaussians that share a footprint: alike bare or coated, and within a ratio of their widths."""
    ordered = sorted(members, key=lambda k: (terms[k].is_coated, terms[k].sigma))
    if np.isinf(ratio):
        return [ordered] if ordered else []
    groups: list[list[int]] = []
    for k in ordered:
        first = terms[groups[-1][0]] if groups else None
        if first and first.is_coated == terms[k].is_coated and terms[k].sigma <= ratio * first.sigma:
            groups[-1].append(k)
        else:
            groups.append([k])
    return groups


def _fill(row: Array, angles: Array, members: list[tuple[GaussianTerm, GaussianTerm, Array]]) -> None:
    """Sum the weights and shares of a group; masking and widths are means by energy."""
    energy = np.stack([term.share.sum(axis=1) * kept for term, _, kept in members])  # (members, NODES)
    mean = np.maximum(energy, 1e-30) / np.maximum(energy, 1e-30).sum(axis=0)
    coated = members[0][0].is_coated
    row[0, :2] = np.average([term.alpha for term, _, _ in members], weights=mean.mean(axis=1)), coated
    row[1, :3], row[2, :3] = (sum(getattr(term, name) for term, _, _ in members) for name in ("plain", "grazing"))
    angles[:, 0, :3] = sum(part.share * kept[:, None] for _, part, kept in members)
    # Masking and refraction of coated ones enter by their moments, not along the footprint
    widths = np.stack([term.moments.width if coated else np.full(NODES, term.sigma) for term, _, _ in members])
    angles[:, 0, 3] = np.sqrt((mean * widths**2).sum(axis=0))
    if coated:
        angles[:, 1, 0] = np.tan((mean * np.stack([term.moments.lean for term, _, _ in members])).sum(axis=0))


def _rgb(values: mi.Vector4f) -> mi.Color3f:
    return mi.Color3f(values.x, values.y, values.z)
