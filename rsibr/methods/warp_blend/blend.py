"""Selection of stored views for a new view, and their weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mitsuba as mi

from rsibr.geometry.partial_views import PartialSphere
from rsibr.geometry.spherical import Weights, area_weights, gnomonic_weights
from rsibr.geometry.viewpoints import Sphere
from rsibr.methods.warp_blend.source_maps import SourceMaps, StoredView


@dataclass
class Mixture:
    """Stored views and their weights, one set a lane or one for all lanes.

    Attributes
    ----------
    views : list of StoredView
        Sources.
    weights : list of mi.Float
        Weights of the sources: non-negative, sum 1.
    """

    views: list[StoredView]
    weights: list[mi.Float]


Mix = Callable[[Sphere, SourceMaps, "mi.Vector3f"], Mixture]
"""(stored directions, maps, view directions) → mixture of stored views for each direction."""


WEIGHTS = {"area": area_weights, "gnomonic": gnomonic_weights}
"""Barycentric weights in a spherical triangle, by name."""


def nearest_mix(sphere: Sphere, sources: SourceMaps, v: mi.Vector3f) -> Mixture:
    """Select the stored view nearest to each direction."""
    return Mixture([sources.view(sphere.nearest(v))], [mi.Float(1)])


def triangle_mix(weights: Callable[[mi.Vector3f, mi.Vector3f, mi.Vector3f, mi.Vector3f], Weights]) -> Mix:
    """Select the three stored views around each direction, with `weights`; Cabral et al. (1999), section 3.4."""

    def mix(sphere: Sphere, sources: SourceMaps, v: mi.Vector3f) -> Mixture:
        if isinstance(sphere, PartialSphere):
            held, shares = sphere.held(v, weights)
            return Mixture([sources.view(index) for index in held], list(shares))
        views = [sources.view(index) for index in sphere.surrounding(v)]
        return Mixture(views, list(weights(v, *(view.v for view in views))))

    return mix
