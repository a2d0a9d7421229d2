"""Band factors of a material's glossy lobes: what one kernel about the mirror direction is fitted to.

Methods that filter the light once, by the direction of reflection, have one round kernel for all of a material's glossy
lobes at all view angles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.albedo import over_disk
from rsibr.lobes.band_factors import BANDS, gaussian
from rsibr.lobes.facet_moments import cosines
from rsibr.methods.lobe_terms import LobeTerms

Array = NDArray[np.float64]


def glossy_factors(terms: LobeTerms, mirror: Array | None = None) -> Array | None:
    """Band factors of the glossy lobes, weighed by the light that they reflect.

    Parameters
    ----------
    terms : LobeTerms
        Terms of the material's lobes.
    mirror : ndarray, shape (NODES, 3), optional
        Directional albedo of delta lobes to count as well, at `rsibr.lobes.facet_moments.cosines`.

    Returns
    -------
    ndarray, shape (len(BANDS),), or None
        Mean over the channels and over the disk of a sphere map; None if nothing is glossy.

    Notes
    -----
    A microfacet lobe of width s mirrors light from a Gaussian of width 2s along the plane of incidence and 2s cos θ
    across; its factors are those of the geometric mean.
    """
    nodes = cosines()
    energy = 0.0 if mirror is None else float(over_disk(mirror, nodes).mean())
    weighted = energy * np.ones(len(BANDS))
    for term in terms.gaussians:
        share = term.share.mean(axis=1, keepdims=True)
        weighted = weighted + over_disk(share * gaussian(2 * term.moments.width * np.sqrt(nodes)), nodes)
        energy += float(over_disk(share, nodes)[0])
    return weighted / energy if energy > 0 else None
