"""Direct light on a coated sphere, texel by texel: what a bake estimates.

The sphere is convex and its light infinitely far away: no ray is traced and nothing shadows. A sample is a point of a
texel, its normal, in spectral rendering four wavelengths, and one direction each from the light and from the BSDF,
combined by the balance heuristic; `rsibr.baking.lattice` spreads the samples of a block. With polarisation light and
BSDF are Mueller matrices; what is kept of their product is the intensity of the light, the first Stokes parameter. A
map holds what an observer sees: linear RGB.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.baking.lattice import MAX_POINTS, ShiftedLattice
from rsibr.geometry.projections.sphere_map import normal_from_disk, stored_coverage
from rsibr.geometry.to_device import to_device
from rsibr.lobes.split import LobeSplit
from rsibr.scene.wavelengths import Wavelengths

MAX_LANES = 2**22
"""Samples in one launch: bounds the memory at about 0.3 GiB whatever the resolution and the samples."""


@dataclass(frozen=True)
class EstimateOptions:
    """What an estimate takes in; by default everything.

    Attributes
    ----------
    grey : bool
        Estimate the red channel alone, and let it stand for all: bit for bit what it is among three.
    light_samples : bool
        Draw directions from the light beside those from the BSDF.
    left_out : tuple of str
        Names of lobes that are left out.
    """

    grey: bool = False
    light_samples: bool = True
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Launch:
    """Blocks of samples that the device is working on, while the host is free for something else."""

    _means: list[list[mi.Float]]

    def means(self) -> NDArray[np.float32]:
        """Wait for the mean radiance of each block, shape (B, lobes, 3): unbiased, as `SphereIntegrator.block`'s.

        A view of memory in which the blocks of one channel lie together.
        """
        by_channel = np.array([[np.array(channel) for channel in lobe] for lobe in self._means], dtype=np.float32)
        return np.broadcast_to(by_channel, (len(by_channel), 3, by_channel.shape[-1])).transpose(2, 0, 1)


class SphereIntegrator:
    """Estimates the radiance of a sphere map, a block of samples at a time.

    It renders in the variant of Mitsuba that it was made in (see `rsibr.backend.rendering`), as light and coating do.

    Parameters
    ----------
    emitter : dict
        Mitsuba emitter at infinity.
    bsdf : mi.BSDF
        The coating.
    resolution : int
        Texels a side.
    split : LobeSplit, optional
        How the material's lobes are kept apart; by default they are not.
    clamp : float, optional
        Radiance [W sr⁻¹ m⁻²] above which a sample counts as this much: quieter, and too dark. A NaN stays one.
    options : EstimateOptions
        What the estimate takes in.
    max_lanes : int
        Samples in one launch at most: bounds the memory.

    Attributes
    ----------
    max_lanes : int
        As given.
    coverage : ndarray, shape (N, N), float32
        Share of each texel inside the disk; zero where that is negligible.
    lobe_names : list of str
        Lobes that a block holds, in their order; "radiance" where they are not kept apart.
    grey : bool
        Whether the three channels are one.
    rendering : Rendering
        What is carried along a path. `block` sets its variant; around many of them set it once, for that takes 0.05 s.
    """

    def __init__(
        self,
        emitter: dict[str, Any],
        bsdf: mi.BSDF,
        resolution: int,
        split: LobeSplit | None = None,
        clamp: float | None = None,
        options: EstimateOptions = EstimateOptions(),
        max_lanes: int = MAX_LANES,
    ) -> None:
        self._light = mi.load_dict({"type": "scene", "light": emitter})
        self._bsdf = bsdf
        self.max_lanes = max_lanes
        self.rendering = backend.current_rendering()
        self._split = split.of_variant(bsdf) if split and len(split.names) > 1 else None
        names = self._split.names if self._split else ["radiance"]
        self._kept = [k for k, name in enumerate(names) if name not in options.left_out]
        self.lobe_names = [names[k] for k in self._kept] if len(self._kept) > 1 else ["radiance"]
        self.grey = options.grey
        self._channels = range(1 if options.grey else 3)
        self._samples_light = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) and options.light_samples
        self._samples_bsdf = self._light.environment() is not None
        self._clamp = None if clamp is None else dr.opaque(mi.Float, clamp)
        self._lay_out(resolution)

    def _lay_out(self, resolution: int) -> None:
        self.coverage = stored_coverage(resolution)
        self._resolution = resolution
        self._side = dr.opaque(mi.UInt32, resolution)  # maps of another size need no other kernel
        self._covered = np.flatnonzero(self.coverage).astype(np.uint32)
        self._texels = to_device(mi.UInt32, self._covered)

    def at_resolution(self, resolution: int) -> SphereIntegrator:
        """Return the same estimator for maps of another size: neither the scene nor a kernel is made anew."""
        other = copy(self)
        other._lay_out(resolution)
        return other

    def block(self, frame: NDArray[np.float64], samples: int, seeds: np.random.SeedSequence) -> NDArray[np.float32]:
        """Mean radiance of each texel over one block of samples.

        Parameters
        ----------
        frame : ndarray, shape (3, 3)
            Columns x, y, z of the map's frame; z points to the viewer.
        samples : int
            Samples a texel at least, spread evenly among each other within a launch.
        seeds : SeedSequence
            Fixes every random number of the block: equal seeds give equal bits.

        Returns
        -------
        ndarray, shape (covered texels, lobes, 3)
            Unbiased estimate of each lobe's radiance [W sr⁻¹ m⁻²] averaged over the part of the texel inside the disk.
        """
        with backend.rendering(self.rendering):
            return self._block(frame, samples, seeds)

    def _block(self, frame: NDArray[np.float64], samples: int, seeds: np.random.SeedSequence) -> NDArray[np.float32]:
        matrix = mi.Matrix3f(frame.astype(np.float32))
        dr.make_opaque(matrix)
        launches = max(math.ceil(samples * dr.width(self._texels) / self.max_lanes), math.ceil(samples / MAX_POINTS))
        each = math.ceil(samples / launches)
        total = np.zeros((dr.width(self._texels), len(self.lobe_names), 3))
        for seed in seeds.generate_state(launches):
            # One launch at a time: each is waited for, and float64 adds any number of them without loss
            total += self._launch(matrix, self._texels, each, int(seed)).means()
        return np.asarray(total / launches, dtype=np.float32)

    def launch(self, frame: NDArray[np.float64], texels: NDArray[np.integer], samples: int, seed: int) -> Launch:
        """Begin to estimate texels in any order, and as often as is liked: one block of samples each.

        Parameters
        ----------
        frame : ndarray, shape (3, 3)
            As in `block`.
        texels : ndarray of int, shape (B,)
            Which of the covered texels each block is for. Blocks are independent, of the same texel too.
        samples : int
            Samples of a block, spread evenly among each other; at most `MAX_POINTS`.
        seed : int
            Fixes every random number, 32 bits.

        Returns
        -------
        Launch
            Not waited for.
        """
        matrix = mi.Matrix3f(frame.astype(np.float32))
        dr.make_opaque(matrix)
        return self._launch(matrix, to_device(mi.UInt32, self._covered[texels]), samples, seed)

    def image(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Lay values of the covered texels out as an image, zero elsewhere."""
        image = np.zeros((self._resolution**2, 3), dtype=np.float32)
        image[np.flatnonzero(self.coverage)] = values
        return image.reshape(self._resolution, self._resolution, 3)

    def _launch(self, matrix: mi.Matrix3f, texels: mi.UInt32, samples: int, seed: int) -> Launch:
        """Mean over `samples` of each entry of `texels`."""
        lanes = dr.width(texels) * samples
        seed_lane, lane = dr.opaque(mi.UInt32, seed), dr.arange(mi.UInt32, lanes)
        block = lane // samples
        dr.eval(block)  # here a division by a literal is quick, and below no kernel knows the count of samples
        points = ShiftedLattice(samples, block, lane - block * dr.opaque(mi.UInt32, samples), seed_lane)
        texel = dr.gather(mi.UInt32, texels, block)
        n = matrix @ normal_from_disk(self._point_in_disk(texel, points.in_texel(), seed_lane))
        v = mi.Vector3f(matrix[0, 2], matrix[1, 2], matrix[2, 2])
        lobes = [[lobe[c] for c in self._channels] for lobe in self._clamped(self._reflected(n, v, points))]
        dr.eval(lobes)  # once for all lobes and channels, not once a sum; what no one asks for is not computed
        means = [[dr.block_sum(channel, samples) / samples for channel in lobe] for lobe in lobes]
        dr.eval(means)
        return Launch(means)

    def _point_in_disk(self, texel: mi.UInt32, jitter: mi.Point2f, seed: mi.UInt32) -> mi.Point2f:
        """A point drawn uniformly from the part of the texel inside the disk.

        The lattice's point is kept where it lies inside. At the rim others are drawn until one does: every sample
        counts, and its weight is one, so that coverage is divided out without any noise.
        """
        step = 2 / mi.Float(self._side)
        column, row = texel % self._side, texel // self._side
        corner = mi.Point2f(column * step - 1, 1 - row * step)

        def point(jitter: mi.Point2f) -> mi.Point2f:
            return mi.Point2f(corner.x + jitter.x * step, corner.y - jitter.y * step)

        generator = mi.PCG32(size=dr.width(texel), initstate=mi.UInt64(seed))

        def draw(_p: mi.Point2f, generator: mi.PCG32) -> tuple[mi.Point2f, mi.PCG32]:
            return point(mi.Point2f(generator.next_float32(), generator.next_float32())), generator

        p, _ = dr.while_loop(
            state=(point(jitter), generator),
            cond=lambda p, _generator: dr.squared_norm(p) >= 1,
            body=draw,
            labels=("p", "generator"),
            label="point_in_disk",
        )
        return p

    def _reflected(self, n: mi.Vector3f, v: mi.Vector3f, points: ShiftedLattice) -> list[mi.Color3f]:
        """One sample of L_r = ∫ f L_i cos θ dω, from the light and from the BSDF, each weighted for the other."""
        wavelengths = Wavelengths.drawn(points.of_wavelengths)
        si = _interaction(n, v, wavelengths)
        lobes = [mi.Color3f(0) for _ in self.lobe_names]
        if self._samples_light:
            radiance, wi = self._from_light(si, points)
            sample = self._lobes(radiance * wavelengths.weight, wi, si.wi, False, wavelengths)
            lobes = [a + b for a, b in zip(lobes, sample, strict=True)]
        if self._samples_bsdf:
            radiance, wi, is_delta = self._from_bsdf(si, points)
            sample = self._lobes(radiance * wavelengths.weight, wi, si.wi, is_delta, wavelengths)
            lobes = [a + b for a, b in zip(lobes, sample, strict=True)]
        return lobes

    def _lobes(
        self,
        radiance: mi.UnpolarizedSpectrum,
        wi: mi.Vector3f,
        wo: mi.Vector3f,
        is_delta: mi.Bool | bool,
        wavelengths: Wavelengths,
    ) -> list[mi.Color3f]:
        if self._split is None:
            return [wavelengths.seen(radiance)]
        lobes = self._split.split(radiance, wi, wo, is_delta, wavelengths)
        return [lobes[k] for k in self._kept]

    def _clamped(self, lobes: list[mi.Color3f]) -> list[mi.Color3f]:
        """Scale the lobes of a sample down to a sum of `clamp` where it exceeds that."""
        if self._clamp is None:
            return lobes
        radiance = mi.Color3f(0)
        for lobe in lobes:
            radiance += lobe
        scale = dr.select(radiance > self._clamp, self._clamp / radiance, 1)  # a NaN passes: it is counted, not hidden
        return [lobe * scale for lobe in lobes]

    def _from_light(
        self, si: mi.SurfaceInteraction3f, points: ShiftedLattice
    ) -> tuple[mi.UnpolarizedSpectrum, mi.Vector3f]:
        light, weight = self._light.sample_emitter_direction(si, points.toward_light(), test_visibility=False)
        wi = si.to_local(light.d)
        value, pdf = self._bsdf.eval_pdf(mi.BSDFContext(), si, wi)
        share = light.pdf / (light.pdf + pdf) if self._samples_bsdf else mi.Float(1)
        radiance = _intensity(si, value, wi, weight) * dr.select(light.delta, 1, share)
        # Only a density of zero is no sample: one of NaN reaches the map, where it is counted
        return dr.select(~(light.pdf <= 0), radiance, 0), wi

    def _from_bsdf(
        self, si: mi.SurfaceInteraction3f, points: ShiftedLattice
    ) -> tuple[mi.UnpolarizedSpectrum, mi.Vector3f, mi.Bool]:
        drawn, weight = self._bsdf.sample(mi.BSDFContext(), si, *points.of_lobe())
        environment = self._light.environment()
        direction = dr.zeros(mi.DirectionSample3f, dr.width(si))
        direction.d = si.to_world(drawn.wo)
        escaped = dr.zeros(mi.SurfaceInteraction3f, dr.width(si))
        escaped.wi = -direction.d
        escaped.wavelengths = si.wavelengths
        pdf = environment.pdf_direction(si, direction) if self._samples_light else mi.Float(0)
        is_delta = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
        share = dr.select(is_delta, 1, drawn.pdf / (drawn.pdf + pdf))
        radiance = _intensity(si, weight, drawn.wo, environment.eval(escaped)) * share
        return dr.select(~(drawn.pdf <= 0), radiance, 0), drawn.wo, is_delta


def _intensity(
    si: mi.SurfaceInteraction3f, value: mi.Spectrum, wi: mi.Vector3f, light: mi.Spectrum
) -> mi.UnpolarizedSpectrum:
    """Light times BSDF; with polarisation in frames that fit together, and the first Stokes parameter of it."""
    if not mi.is_polarized:
        return value * light
    return mi.unpolarized_spectrum(si.to_world_mueller(value, -wi, si.wi) * light)


def _interaction(n: mi.Vector3f, v: mi.Vector3f, wavelengths: Wavelengths) -> mi.SurfaceInteraction3f:
    """A point of the surface with normal `n`, seen from `v`."""
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(n))
    si.t = 1.0
    si.n = mi.Normal3f(n)
    si.sh_frame = mi.Frame3f(n)
    si.wi = si.to_local(v)
    si.wavelengths = wavelengths.nm
    return si
