"""Reflectance of a mirror ball, by angle."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.geometry.sphere_interaction import interaction

_NODES = 256
_LEAST = 1e-3  # a ball that mirrors less shows nothing but noise


@dataclass(frozen=True, eq=False)
class Reflectance:
    """Reflectance of a mirror.

    Attributes
    ----------
    name : str
        For messages.
    table : ndarray, shape (256, 3)
        R, G, B at cosines of the incidence spread evenly over [0, 1].
    """

    name: str
    table: NDArray[np.float64]

    def at(self, cosine: mi.Float) -> mi.Color3f:
        """Reflectance at cosines of the incidence."""
        flat = mi.Float(self.table.astype(np.float32).ravel())
        place = dr.clip(cosine, 0, 1) * (_NODES - 1)
        low = dr.minimum(mi.UInt32(place), _NODES - 2)
        share = place - mi.Float(low)
        return mi.Color3f(
            *(
                dr.lerp(dr.gather(mi.Float, flat, 3 * low + k), dr.gather(mi.Float, flat, 3 * low + 3 + k), share)
                for k in range(3)
            )
        )


def reflectance_of(said: str | float) -> Reflectance:
    """Reflectance that a user names.

    Parameters
    ----------
    said : str or float
        A metal that Mitsuba knows, such as `Ag`, `Al` or `Cr`, with its Fresnel reflectance by angle; or a number in
        [0.001, 1], the same for all angles and channels.

    Raises
    ------
    InputError
        If it is neither.

    Examples
    --------
    >>> reflectance_of("0.5").table[0].tolist()
    [0.5, 0.5, 0.5]
    """
    try:
        number = float(said)
    except ValueError:
        return _of_metal(str(said))
    if not _LEAST <= number <= 1:
        raise InputError(f"a reflectance of {number:g}", where="reflectance", fix=f"give {_LEAST:g} to 1")
    return Reflectance(f"{number:g}", np.full((_NODES, 3), number))


@backend.in_session
def _of_metal(metal: str) -> Reflectance:
    try:
        bsdf = backend.load({"type": "conductor", "material": metal})
    except (RuntimeError, InputError) as error:
        fix = "name a metal that Mitsuba knows, such as Ag, Al or Cr, or give a number"
        raise InputError(f"unknown metal '{metal}'", where="reflectance", fix=fix) from error
    cosine = np.linspace(0, 1, _NODES)
    wi = np.stack([np.sqrt(1 - cosine**2), np.zeros_like(cosine), np.maximum(cosine, 1e-4)])
    hit = interaction(mi.Vector3f(wi.astype(np.float32)))
    _, weight = bsdf.sample(mi.BSDFContext(), hit, mi.Float(0.5), mi.Point2f(0.5))
    return Reflectance(metal, np.array(weight, dtype=np.float64).reshape(3, -1).T)
