"""Latitude–longitude projections by name, as an option of formats."""

from __future__ import annotations

from rsibr.geometry.projections.latlong import LatLong
from rsibr.geometry.projections.projection import projection, projection_names
from rsibr.methods.options import choice


def latlong_projection(name: str) -> LatLong:
    """Latitude–longitude projection of a name.

    Raises
    ------
    InputError
        If there is none; the message lists all.
    """
    known = {one: projection(one) for one in projection_names()}
    found = known[choice("axes", name, [one for one, kind in known.items() if isinstance(kind, LatLong)])]
    assert isinstance(found, LatLong)  # for the type: `choice` lets no other pass
    return found
