"""Measurements of the material: dependence on view angle, colour, rotation and position."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.sphere_interaction import ON_THE_EQUATOR, interaction
from rsibr.lobes.albedo import over_disk
from rsibr.lobes.bsdf_eval import retro_ratio
from rsibr.lobes.fit_error import FitErrors
from rsibr.lobes.low_discrepancy import sobol
from rsibr.lobes.split import Lobe, LobeSplit

COSINES = (0.95, 0.75, 0.5, 0.25)
"""Cosines of the view angles at which the BRDF is evaluated."""

TURNS = (0.7, 2.1, 4.4)
"""Angles [rad] of rotation about the normal by which anisotropy is measured."""

_DRAWS = 2**9
_SEED = 17


@dataclass(frozen=True, eq=False)
class LobeProbe:
    """Measurements of one lobe.

    Attributes
    ----------
    name : str
        Name of its layer.
    alpha : float
        Roughness α; see `rsibr.lobes.split.Lobe`.
    albedo : ndarray, shape (3,)
        Directional albedo, mean over the disk of a sphere map.
    share : float
        Share of the reflected light, mean over the disk and the channels.
    shape_error : float
        Relative root mean square deviation from E(θ_o) cos θ_i / π; 0 for a Lambertian lobe.
    kind : {"diffuse", "glossy", "mirror"}
        Selects the warp.
    anisotropy, variation : float
        Anisotropy and variation over the surface of the whole material without its delta lobe, not of this lobe.
    """

    name: str
    alpha: float
    albedo: NDArray[np.float64]
    share: float
    shape_error: float
    kind: str
    anisotropy: float = 0.0
    variation: float = 0.0


@dataclass(frozen=True, eq=False)
class MaterialProbe:
    """Measurements of a material.

    Attributes
    ----------
    lobes : tuple of LobeProbe
        Its lobes, widest first; a delta lobe last.
    albedo : ndarray, shape (NODES, 3)
        Directional albedo of all lobes together by view angle.
    chroma : float
        Relative root mean square difference of green and blue from red: 0 for a grey material.
    anisotropy : float
        Mean change of the BRDF under rotation about the normal, relative to its mean.
    variation : float
        Mean change of the BRDF over the surface, relative to its mean.
    retro_ratio : float
        See `rsibr.lobes.bsdf_eval.retro_ratio`.
    fresnel : float
        relMSE over the disk of replacing the albedo by its mean over the angle.
    fit : FitErrors
        Errors of the fitted lobes.
    """

    lobes: tuple[LobeProbe, ...]
    albedo: NDArray[np.float64]
    chroma: float
    anisotropy: float
    variation: float
    retro_ratio: float
    fresnel: float
    fit: FitErrors


def probe_material(bsdf: mi.BSDF, split: LobeSplit) -> MaterialProbe:
    """Measure a material.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any opaque BSDF.
    split : LobeSplit
        Its lobes.

    Returns
    -------
    MaterialProbe

    Notes
    -----
    Half of the directions are sampled from the BSDF, half uniformly. Three kernels.
    """
    albedo = np.sum([lobe.albedo for lobe in split.lobes], axis=0)
    smooth = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
    drawn = _Draws.of(bsdf) if smooth else None
    shapes = drawn.shape_errors(split) if drawn else []
    turning, varying = (drawn.anisotropy, drawn.variation) if drawn else (0.0, 0.0)
    lobes = [
        _lobe(lobe, albedo, *((shapes[k], turning, varying) if k < len(shapes) else (0.0, 0.0, 0.0)))
        for k, lobe in enumerate(split.lobes)
    ]
    mirror = [lobe.albedo for lobe in split.lobes if lobe.is_mirror]
    return MaterialProbe(
        lobes=tuple(lobes),
        albedo=albedo,
        chroma=max([drawn.chroma if drawn else 0.0, *(_spread(table) for table in mirror)]),
        anisotropy=turning,
        variation=varying,
        retro_ratio=retro_ratio(bsdf) if smooth else 1.0,
        fresnel=_variation_over_angle(albedo),
        fit=FitErrors.of(split),
    )


def _lobe(lobe: Lobe, whole: NDArray[np.float64], shape_error: float, anisotropy: float, variation: float) -> LobeProbe:
    share = float(over_disk(lobe.albedo).sum() / max(over_disk(whole).sum(), 1e-30))
    return LobeProbe(
        lobe.name, lobe.alpha, over_disk(lobe.albedo), share, shape_error, lobe.kind, anisotropy, variation
    )


def _variation_over_angle(albedo: NDArray[np.float64]) -> float:
    mean = over_disk(albedo)
    floor = (0.1 * mean.mean()) ** 2 + 1e-30
    return float(over_disk((albedo - mean) ** 2 / (albedo**2 + floor)).mean())


def _spread(values: NDArray[np.float64], weight: NDArray[np.float64] | float = 1.0) -> float:
    """Root mean square difference of green and blue from red, relative to that of the largest channel."""
    difference = ((values[:, 1:] - values[:, :1]) ** 2).max(axis=1)
    return float(np.sqrt((weight * difference).sum() / max((weight * values.max(axis=1) ** 2).sum(), 1e-300)))


@dataclass(frozen=True, eq=False)
class _Draws:
    """BRDF at sampled directions: `values` f·cos θ_i [sr⁻¹] of shape (sets, n, 3).

    The sets: as sampled, rotated by each of `TURNS`, at random positions on the surface.
    """

    wi: NDArray[np.float64]
    wo: NDArray[np.float64]
    values: NDArray[np.float64]
    weight: NDArray[np.float64]

    @classmethod
    def of(cls, bsdf: mi.BSDF) -> _Draws:
        """Sample the directions, and evaluate all sets in one kernel."""
        # Half of the light directions from the BSDF, half uniform over the hemisphere
        u = sobol(5, _DRAWS * len(COSINES), seed=_SEED).astype(np.float32)
        cosine = np.repeat(COSINES, _DRAWS)
        wo = np.stack([np.sqrt(1 - cosine**2), np.zeros_like(cosine), cosine], axis=1)
        sample, _ = bsdf.sample(_smooth_only(), interaction(_device(wo)), mi.Float(u[:, 0]), mi.Point2f(u[:, 1:3].T))
        by_bsdf = np.array(sample.wo, dtype=np.float64).reshape(3, -1).T
        height, azimuth = u[:, 3], 2 * np.pi * u[:, 4]
        sine = np.sqrt(1 - height**2)
        uniform = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), height], axis=1).astype(np.float64)
        wi, wo = np.concatenate([by_bsdf, uniform]), np.concatenate([wo, wo])
        # Values of all sets, and the weights of the balance heuristic
        usable = np.isfinite(wi).all(axis=1) & (wi[:, 2] > 1e-4)
        values, density = _evaluate(bsdf, wi, wo, usable)
        return cls(wi, wo, values, np.where(usable, 1 / (density + 1 / (2 * np.pi)), 0))

    @property
    def chroma(self) -> float:
        """Relative difference of green and blue from red."""
        return _spread(self.values[0], self.weight)

    @property
    def anisotropy(self) -> float:
        """Mean change under rotation, the largest of all angles."""
        return max(self._change(k) for k in range(1, 1 + len(TURNS)))

    @property
    def variation(self) -> float:
        """Mean change over the surface."""
        return self._change(1 + len(TURNS))

    def shape_errors(self, split: LobeSplit) -> list[float]:
        """Deviation of each smooth lobe from E(θ_o) cos θ_i / π; see `LobeProbe.shape_error`."""
        uniform = slice(len(self.wi) // 2, None)  # uniform directions resolve every lobe equally
        wi, wo, value = self.wi[uniform], self.wo[uniform], self.values[0][uniform]
        errors = []
        for share in split.shares(_device(wi), _device(wo)):
            part = value * np.array(share, dtype=np.float64).reshape(3, -1).T
            errors.append(
                _distance_from_lambert(part.reshape(len(COSINES), _DRAWS, 3), wi[:, 2].reshape(-1, _DRAWS, 1))
            )
        return errors

    def _change(self, other: int) -> float:
        difference = np.abs(self.values[other] - self.values[0]).sum(axis=1)
        return float((self.weight * difference).sum() / max((self.weight * self.values[0].sum(axis=1)).sum(), 1e-300))


def _distance_from_lambert(part: NDArray[np.float64], cosine: NDArray[np.float64]) -> float:
    """Relative deviation of f·cos θ_i, shape (angles, n, 3), from the Lambertian lobe of equal energy at each angle."""
    # Mean over the same points, so that quadrature noise does not count as deviation
    lambert = part.sum(axis=1, keepdims=True) / cosine.sum(axis=1, keepdims=True) * cosine
    return float(np.sqrt(((part - lambert) ** 2).sum() / max((lambert**2).sum(), 1e-300)))


def _evaluate(
    bsdf: mi.BSDF, wi: NDArray[np.float64], wo: NDArray[np.float64], usable: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """BRDF times cosine of all sets, and the density of the BSDF's sampling, in one kernel launch."""
    turned = [(_turned(wi, angle), _turned(wo, angle)) for angle in (0.0, *TURNS, 0.0)]
    lights, views = (_device(np.concatenate(part)) for part in zip(*turned, strict=True))
    place = sobol(2, len(wi), seed=_SEED).astype(np.float32)
    fixed = np.tile(np.array(ON_THE_EQUATOR, np.float32), (len(wi) * (len(turned) - 1), 1))
    si = interaction(views, uv=mi.Point2f(np.concatenate([fixed, place]).T))
    value, pdf = bsdf.eval_pdf(_smooth_only(), si, lights)
    flat = np.broadcast_to(np.array(value, dtype=np.float64).reshape(3, -1).T, (len(turned) * len(wi), 3))
    values = flat.reshape(len(turned), len(wi), 3)
    density = np.broadcast_to(np.array(pdf, dtype=np.float64), len(turned) * len(wi))[: len(wi)]
    sound = usable & np.isfinite(values).all(axis=(0, 2)) & np.isfinite(density)
    return np.where(sound[:, None], values, 0), np.where(sound, density, 0)


def _smooth_only() -> mi.BSDFContext:
    context = mi.BSDFContext()
    context.type_mask = int(mi.BSDFFlags.Smooth)
    return context


def _turned(w: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(w @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]]))


def _device(w: NDArray[np.float64]) -> mi.Vector3f:
    return mi.Vector3f(w.T.astype(np.float32))
