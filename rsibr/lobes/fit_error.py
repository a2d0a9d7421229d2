"""Error of the fitted lobes in the model's own terms: share of the reflected light gathered from wrong directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.albedo import node_cosines, over_disk
from rsibr.lobes.probe_directions import ProbeDirections, probe_directions
from rsibr.lobes.shape_fit import angle_errors, shape_values

if TYPE_CHECKING:
    from rsibr.lobes.split import LobeSplit

Array = NDArray[np.float64]

COSINES = (0.95, 0.7, 0.5, 0.3, 0.18, 0.08)
"""Cosines of the view angles, others than those of the fit."""

_DRAWS = 128
_SEED = 11  # other light directions than those of the fit


@dataclass(frozen=True, eq=False)
class FitErrors:
    """Errors of the fitted lobes of a material at `COSINES`, each in [0, 1].

    Attributes
    ----------
    lobes : tuple of ndarray, each of shape (angles,)
        Share of each lobe's light that its fit gathers from wrong directions; zero for a delta lobe.
    whole : ndarray, shape (angles,)
        The same share of all reflected light: mean of the lobes, weighted by their albedos at the angle. An upper
        bound, as errors of lobes that cancel are added.
    mean : float
        `whole`, weighted by the reflected light over the disk of a sphere map.
    """

    lobes: tuple[Array, ...]
    whole: Array
    mean: float

    @classmethod
    def of(cls, split: LobeSplit) -> FitErrors:
        """Hold the fit of each lobe against the BRDF at directions that the fit has not seen; one kernel.

        Parameters
        ----------
        split : LobeSplit
            Lobes of a material, in RGB rendering.

        Examples
        --------
        >>> split = LobeSplit.of(mi.load_dict({"type": "diffuse"}))              # doctest: +SKIP
        >>> FitErrors.of(split).mean < 1e-3                                      # doctest: +SKIP
        True
        """
        probes = held_out()
        errors = [np.zeros(len(COSINES)) for _ in split.lobes]
        for k, values in enumerate(split.values(probes)):  # a delta lobe is the last and has none
            errors[k] = angle_errors(values, shape_values(split.lobes[k].shape, probes), probes) / 2
        return cls.weighted(errors, [lobe.albedo for lobe in split.lobes])

    @classmethod
    def weighted(cls, errors: Sequence[Array], albedos: Sequence[Array]) -> FitErrors:
        """Make the errors of a material from those of its lobes and their albedos, each of shape (NODES, 3)."""
        nodes = node_cosines()
        light = np.array([albedo.mean(axis=1) for albedo in albedos])
        at_angles = np.array([np.interp(COSINES, nodes, table) for table in light])
        whole = (at_angles * errors).sum(axis=0) / np.maximum(at_angles.sum(axis=0), 1e-30)
        everywhere = np.array([np.interp(nodes, COSINES[::-1], error[::-1]) for error in errors])
        wrong, all_light = over_disk((light * everywhere).sum(axis=0)), over_disk(light.sum(axis=0))
        return cls(tuple(errors), whole, float(wrong / max(float(all_light), 1e-30)))


def held_out() -> ProbeDirections:
    """Directions that the fit has not seen."""
    return probe_directions(COSINES, _DRAWS, _SEED)
