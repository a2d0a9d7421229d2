"""Shape of a lobe in the manifest."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.lobes.probe_directions import probe_directions
from rsibr.lobes.shape_fit import fit_shape
from rsibr.store.manifest import GaussianRecord, LobeRecord, ShapeRecord, Vector

_DIGITS = 6


def shape_record(shape: LobeShape) -> ShapeRecord | None:
    """Make the record of a shape, its numbers rounded to six digits; None for a delta lobe."""
    if shape.is_mirror:
        return None
    return ShapeRecord(
        alpha=_rounded(shape.alpha),
        bare=_records(shape.bare),
        coated=_records(shape.coated),
        matte=(_colour(shape.matte[0]), _colour(shape.matte[1])),
    )


def shape_of(record: LobeRecord) -> LobeShape:
    """Shape of a stored lobe.

    A lobe without proxies is a delta lobe. A lobe of a bake older than shapes has that of its proxy, which is of GGX.
    """
    if not record.proxies:
        return LobeShape.mirror()
    if record.shape is None:
        return _of_proxy(record)
    shape = record.shape
    return LobeShape(shape.alpha, _mixture(shape.bare), _mixture(shape.coated), np.array(shape.matte))


def _of_proxy(record: LobeRecord) -> LobeShape:
    alphas = tuple(proxy.alpha for proxy in record.proxies)
    proxy = ProxyLobe(alphas, tuple(np.array(one.coefficients) for one in record.proxies))
    probes = probe_directions()
    wi, wo = (mi.Vector3f(np.ascontiguousarray(w.T, dtype=np.float32)) for w in (probes.wi, probes.wo))
    values = np.array(proxy.brdf_cosine(wi, wo), dtype=np.float64).T
    return fit_shape(values, proxy.alpha, with_matte=proxy.is_matte)


def _records(mixture: Gaussians) -> tuple[GaussianRecord, ...]:
    terms = zip(mixture.sigmas, mixture.plain, mixture.grazing, strict=True)
    return tuple(
        GaussianRecord(sigma=_rounded(sigma), plain=_colour(plain), grazing=_colour(grazing))
        for sigma, plain, grazing in terms
    )


def _mixture(records: tuple[GaussianRecord, ...]) -> Gaussians:
    if not records:
        return Gaussians.none()
    sigmas = np.array([record.sigma for record in records])
    plain, grazing = (np.array([getattr(record, name) for record in records]) for name in ("plain", "grazing"))
    return Gaussians(sigmas, plain, grazing)


def _colour(values: NDArray[np.float64]) -> Vector:
    r, g, b = (_rounded(value) for value in values)
    return r, g, b


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
