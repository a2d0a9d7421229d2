"""Shape of a stored lobe, from the fit in the manifest."""

from __future__ import annotations

import numpy as np

from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.gaussians import LobeShape
from rsibr.store.manifest import LobeRecord


def shape_of(record: LobeRecord) -> LobeShape:
    """Shape of a lobe as a mixture of Gaussians over slopes; a lobe without proxies is a delta lobe."""
    if not record.proxies:
        return LobeShape.mirror()
    alphas = tuple(proxy.alpha for proxy in record.proxies)
    return LobeShape.of(ProxyLobe(alphas, tuple(np.array(proxy.coefficients) for proxy in record.proxies)))
