"""Direct illumination of a coated sphere, texel by texel: the estimator of a bake.

The sphere is convex and the environment distant, so no ray is traced and there is no occlusion. A sample is a point of
a texel with its normal, four wavelengths in spectral rendering, and one direction each from the emitter and from the
BSDF, combined by the balance heuristic as MIS weight (docs/method.md, eq. 5). `rsibr.baking.lattice` stratifies the
samples of a block. In polarised rendering emitter and BSDF are Mueller matrices, and the intensity of their product,
the first Stokes parameter, is kept. Maps hold linear RGB.
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
from rsibr.geometry.sphere_interaction import sphere_interaction
from rsibr.geometry.to_device import to_device
from rsibr.lobes.split import LobeSplit
from rsibr.scene.sampling_density import sound_density
from rsibr.scene.wavelengths import Wavelengths

MAX_LANES = 2**22
"""Maximum samples of one launch: limits memory to about 0.3 GiB for any resolution and number of samples."""


@dataclass(frozen=True)
class EstimateOptions:
    """Simplifications of an estimate; none by default.

    Attributes
    ----------
    grey : bool
        Estimate the red channel only and use it for all three; it is bit-identical to that of an RGB estimate.
    light_samples : bool
        Draw directions from the emitter as well as from the BSDF.
    left_out : tuple of str
        Names of lobes to leave out.
    """

    grey: bool = False
    light_samples: bool = True
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Launch:
    """Asynchronous launch: blocks of samples in progress on the device."""

    _means: list[list[mi.Float]]

    def means(self) -> NDArray[np.float32]:
        """Wait for the device, and return the mean radiance of each block, shape (B, lobes, 3); see `block`.

        A transposed view of an array in which the blocks of one channel are contiguous.
        """
        by_channel = np.array([[np.array(channel) for channel in lobe] for lobe in self._means], dtype=np.float32)
        return np.broadcast_to(by_channel, (len(by_channel), 3, by_channel.shape[-1])).transpose(2, 0, 1)


class SphereIntegrator:
    """Monte Carlo estimator of the radiance of a sphere map, in blocks of samples.

    It renders in the Mitsuba variant in which it was made, as do emitter and BSDF; see `rsibr.backend.rendering`.

    Parameters
    ----------
    emitter : dict
        Mitsuba emitter at infinity.
    bsdf : mi.BSDF
        BSDF of the coating.
    resolution : int
        Texels a side.
    split : LobeSplit, optional
        Split of the BSDF into lobes that are estimated separately; by default a single lobe.
    clamp : float, optional
        Maximum radiance of a sample [W sr⁻¹ m⁻²]: less noise, and a negative bias. NaN is not clamped.
    options : EstimateOptions
        Simplifications of the estimate.
    max_lanes : int
        Maximum samples of one launch; limits memory.

    Attributes
    ----------
    max_lanes : int
        As given.
    coverage : ndarray, shape (N, N), float32
        Share of each texel inside the disk; zero where it is negligible.
    lobe_names : list of str
        Lobes of a block in order; "radiance" where they are not estimated separately.
    grey : bool
        Whether only one channel is estimated.
    rendering : Rendering
        Rendering of the variant. `block` sets the variant; around many calls set it once, because it takes 0.05 s.
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
        self._light = backend.load({"type": "scene", "light": emitter})
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
        self._side = dr.opaque(mi.UInt32, resolution)  # opaque, so that other resolutions share the kernel
        self._covered = np.flatnonzero(self.coverage).astype(np.uint32)
        self._texels = to_device(mi.UInt32, self._covered)

    def at_resolution(self, resolution: int) -> SphereIntegrator:
        """Return the same estimator for maps of another size, with the same scene and kernels."""
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
            Minimum samples a texel, stratified within a launch.
        seeds : SeedSequence
            Determines all random numbers of the block: equal seeds give equal bits.

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
            # One launch at a time, to limit memory; float64 sums them without loss
            total += self._launch(matrix, self._texels, each, int(seed)).means()
        return np.asarray(total / launches, dtype=np.float32)

    def launch(self, frame: NDArray[np.float64], texels: NDArray[np.integer], samples: int, seed: int) -> Launch:
        """Start to estimate one block of samples for each entry of `texels`; entries may repeat, in any order.

        Parameters
        ----------
        frame : ndarray, shape (3, 3)
            As in `block`.
        texels : ndarray of int, shape (B,)
            Index among the covered texels for each block. All blocks are independent, also those of one texel.
        samples : int
            Samples a block, stratified; at most `MAX_POINTS`.
        seed : int
            Determines all random numbers, 32 bits.

        Returns
        -------
        Launch
            Asynchronous result.
        """
        matrix = mi.Matrix3f(frame.astype(np.float32))
        dr.make_opaque(matrix)
        return self._launch(matrix, to_device(mi.UInt32, self._covered[texels]), samples, seed)

    def image(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Scatter values of the covered texels, shape (T, 3), into an image of shape (N, N, 3), zero elsewhere."""
        image = np.zeros((self._resolution**2, 3), dtype=np.float32)
        image[np.flatnonzero(self.coverage)] = values
        return image.reshape(self._resolution, self._resolution, 3)

    def _launch(self, matrix: mi.Matrix3f, texels: mi.UInt32, samples: int, seed: int) -> Launch:
        """Start to estimate the mean over `samples` for each entry of `texels`."""
        # ---- One sample a lane; random numbers from the lattice of its block ----
        lanes = dr.width(texels) * samples
        seed_lane, lane = dr.opaque(mi.UInt32, seed), dr.arange(mi.UInt32, lanes)
        block = lane // samples
        dr.eval(block)  # a separate kernel: division by a literal is fast, and later kernels do not depend on `samples`
        points = ShiftedLattice(samples, block, lane - block * dr.opaque(mi.UInt32, samples), seed_lane)
        # ---- Surface point and view ----
        texel = dr.gather(mi.UInt32, texels, block)
        n = matrix @ normal_from_disk(self._point_in_disk(texel, points.in_texel(), seed_lane))
        v = mi.Vector3f(matrix[0, 2], matrix[1, 2], matrix[2, 2])
        # ---- Radiance of each lobe and channel, in one kernel; unused ones are not computed ----
        every = dr.zeros(mi.Float, lanes)  # a channel that no sample lights is a literal zero of one lane
        lobes = [[lobe[c] + every for c in self._channels] for lobe in self._clamped(self._reflected(n, v, points))]
        dr.eval(lobes)
        # ---- Mean over each block ----
        means = [[dr.block_sum(channel, samples) / samples for channel in lobe] for lobe in lobes]
        dr.eval(means)
        return Launch(means)

    def _point_in_disk(self, texel: mi.UInt32, jitter: mi.Point2f, seed: mi.UInt32) -> mi.Point2f:
        """Draw a point uniformly from the part of the texel inside the disk.

        The point of the lattice is used if it lies inside the disk. In a texel at the rim, rejected points are redrawn
        until one lies inside. Every sample then has weight one, and coverage is divided out without noise.
        """
        # ---- Point of the texel ----
        step = 2 / mi.Float(self._side)
        column, row = texel % self._side, texel // self._side
        corner = mi.Point2f(column * step - 1, 1 - row * step)

        def point(jitter: mi.Point2f) -> mi.Point2f:
            return mi.Point2f(corner.x + jitter.x * step, corner.y - jitter.y * step)

        # ---- Rejection sampling, starting with the lattice's point ----
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
        """One sample of L_r = ∫ f L_i cos θ dω for each lobe, by emitter and BSDF sampling with MIS weights."""
        wavelengths = Wavelengths.drawn(points.of_wavelengths)
        si = sphere_interaction(n, v, wavelengths.nm)
        lobes = [mi.Color3f(0) for _ in self.lobe_names]
        # ---- Emitter sampling ----
        if self._samples_light:
            radiance, wi = self._from_light(si, points)
            sample = self._lobes(radiance * wavelengths.weight, wi, si, False, wavelengths)
            lobes = [a + b for a, b in zip(lobes, sample, strict=True)]
        # ---- BSDF sampling ----
        if self._samples_bsdf:
            radiance, wi, is_delta = self._from_bsdf(si, points)
            sample = self._lobes(radiance * wavelengths.weight, wi, si, is_delta, wavelengths)
            lobes = [a + b for a, b in zip(lobes, sample, strict=True)]
        return lobes

    def _lobes(
        self,
        radiance: mi.UnpolarizedSpectrum,
        wi: mi.Vector3f,
        si: mi.SurfaceInteraction3f,
        is_delta: mi.Bool | bool,
        wavelengths: Wavelengths,
    ) -> list[mi.Color3f]:
        if self._split is None:
            return [wavelengths.seen(radiance)]
        lobes = self._split.split(radiance, wi, si, is_delta, wavelengths)
        return [lobes[k] for k in self._kept]

    def _clamped(self, lobes: list[mi.Color3f]) -> list[mi.Color3f]:
        """Scale the lobes of a sample so that their sum does not exceed `clamp`."""
        if self._clamp is None:
            return lobes
        radiance = mi.Color3f(0)
        for lobe in lobes:
            radiance += lobe
        scale = dr.select(radiance > self._clamp, self._clamp / radiance, 1)  # NaN passes, for the health check
        return [lobe * scale for lobe in lobes]

    def _from_light(
        self, si: mi.SurfaceInteraction3f, points: ShiftedLattice
    ) -> tuple[mi.UnpolarizedSpectrum, mi.Vector3f]:
        light, weight = self._light.sample_emitter_direction(si, points.toward_light(), test_visibility=False)
        wi = si.to_local(light.d)
        value, pdf = self._bsdf.eval_pdf(mi.BSDFContext(), si, wi)
        share = light.pdf / (light.pdf + sound_density(value, pdf)) if self._samples_bsdf else mi.Float(1)
        radiance = _intensity(si, value, wi, weight) * dr.select(light.delta, 1, share)
        # A density of zero means no sample. NaN is kept, so that the health check counts it
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
    """Emitter radiance times BSDF; in polarised rendering with matched Stokes frames, reduced to the intensity."""
    if not mi.is_polarized:
        return value * light
    return mi.unpolarized_spectrum(si.to_world_mueller(value, -wi, si.wi) * light)
