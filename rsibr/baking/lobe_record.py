"""Manifest record of a lobe."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.split import Lobe
from rsibr.planning.plan import Plan
from rsibr.store.lobe_shape import shape_record
from rsibr.store.manifest import LobeRecord, ProxyRecord


def lobe_record(lobe: Lobe, plan: Plan) -> LobeRecord:
    """Make the record of a lobe: numbers rounded to six digits, and the number of views that store it separately."""
    proxy = lobe.proxy
    terms = () if proxy is None else zip(proxy.alphas, proxy.coefficients, strict=True)
    return LobeRecord(
        name=lobe.name,
        alpha=lobe.alpha,
        albedo=_colours(lobe.albedo),
        proxies=tuple(ProxyRecord(alpha=alpha, coefficients=_colours(values)) for alpha, values in terms),
        shape=shape_record(lobe.shape),
        views=next(planned.own_views for planned in plan.lobes if planned.name == lobe.name),
    )


def _colours(values: NDArray[np.float64]) -> tuple[tuple[float, float, float], ...]:
    return tuple((r, g, b) for r, g, b in values.round(6).tolist())
