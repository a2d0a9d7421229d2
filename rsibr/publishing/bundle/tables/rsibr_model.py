"""Model of `rsibr`: weights of the half-vector pyramid, footprints, quadrature, matte parts, delta lobe, belief."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.light.radiance import Light
from rsibr.lobes.basis import LAMBERT
from rsibr.lobes.proxy_ratio import NODES
from rsibr.methods.lobe_albedo import divisible
from rsibr.methods.rsibr.belief import Belief
from rsibr.methods.rsibr.delta_lobe import mirror_fineness
from rsibr.methods.rsibr.fidelity import FAST
from rsibr.methods.rsibr.half_vector_pyramid import LADDER, taps
from rsibr.methods.rsibr.model_tables import ModelTables
from rsibr.methods.rsibr.residual_method import ResidualOptions
from rsibr.methods.rsibr.rsibr import believed, scaled_lobes
from rsibr.publishing.bundle.contents import Part, Request, contributes
from rsibr.publishing.bundle.encoding import Encoded, Precision, encoded, encoded_images
from rsibr.store.manifest import LobeRecord

_COLOURS = 3  # of a term of a proxy


@contributes("model", to=("rsibr",))
def model(request: Request) -> Part:
    """Tables of the model, for maps of each size that the page makes, and how far it is believed."""
    options = ResidualOptions(request.methods.inputs)
    inputs = options.inputs
    belief, _ = believed(options, FAST) if options.carries else (Belief.full(len(inputs.lobes)), None)
    tables = ModelTables.of(list(scaled_lobes(inputs, belief).values()), None, FAST)
    sized = {size: tables.for_maps(size) for size in request.sizes}
    arrays = {
        "albedo": _four(divisible(np.sum([np.array(record.albedo) for record in inputs.lobes], axis=0))),
        "trust": _four(np.repeat(belief.residual[:, None], 3, axis=1)),
        "weight": _four(np.repeat(belief.weight[:, None], 3, axis=1)),
    }
    for size, one in sized.items():
        arrays |= {} if one.levels is None else {f"levels.{size}": encoded(one.levels.astype(np.float32))}
        arrays |= {} if one.sharp is None else {f"sharp.{size}": encoded(one.sharp.seen[0, :, 0].astype(np.float32))}
    if tables.wide is not None:
        arrays |= {"wide": _four(tables.wide.share), "points": encoded(_points(tables, request.precision))}
    for k, term in enumerate(tables.matte):
        irradiance = encoded_images(inputs.light.irradiance(term.weights), request.precision)
        arrays |= {f"matte.{k}": _four(term.share), f"irradiance.{k}": irradiance}
    part = Part(_meta(options, belief, tables, any(one.levels is not None for one in sized.values())), arrays)
    if tables.mirror is not None:
        _add_mirror(part, tables.mirror, options, request)
    if not inputs.light.delta.is_black:
        _add_delta_lights(part, inputs.light, inputs.lobes)
    return part


def _meta(options: ResidualOptions, belief: Belief, tables: ModelTables, has_levels: bool) -> dict[str, Any]:
    has_gaussians = bool(tables.terms.gaussians)
    return {
        "carries": options.carries,
        "believes": belief.is_full,
        "isHedged": belief.is_hedged,
        "keepsNegatives": options.inputs.bake.rendering != "rgb",
        "carriesMirror": options.separate_mirror is None,
        "side": FAST.resolution,
        "hasLevels": has_levels,
        "matte": len(tables.matte),
        "lightLevels": 99 if has_gaussians else 1 if tables.mirror is not None else 0,
        "ladder": [{"halvings": before[0], "taps": taps(before, after).tolist()} for before, after in pairwise(LADDER)]
        + [{"halvings": LADDER[-1][0], "taps": []}],
    }


def _points(tables: ModelTables, precision: Precision) -> NDArray[np.floating[Any]]:
    """For each ring and point of the quadrature (x, y, level, 0) and (r, g, b, 0), shape (rings, points, 2, 4)."""
    assert tables.wide is not None
    quadrature = tables.wide.quadrature
    rows = np.zeros((*quadrature.levels.shape, 2, 4), np.float32)
    rows[..., 0, :2], rows[..., 0, 2], rows[..., 1, :3] = quadrature.places, quadrature.levels, quadrature.weights
    return rows if precision == "float" else rows.astype(np.float16)


def _add_mirror(part: Part, albedo: NDArray[np.float64], options: ResidualOptions, request: Request) -> None:
    """Albedo of the delta lobe, and the image that it mirrors where the bake keeps it."""
    light = options.inputs.light
    part.arrays["mirror"] = _four(albedo)
    part.meta["mirror"] = {"fineness": mirror_fineness(light, options.mirror_density)}
    if light.image is not None:
        part.arrays["mirrorImage"] = encoded_images(light.image, request.precision)
        part.meta["mirror"]["toImage"] = light.frame.astype(np.float32).ravel().tolist()  # its transpose, by columns


def _add_delta_lights(part: Part, light: Light, lobes: tuple[LobeRecord, ...]) -> None:
    """Lights without extent, and the proxies that reflect them with their ratios, lobe by lobe."""
    proxied = [lobe for lobe in lobes if lobe.proxies]
    rows = [_proxy(lobe) for lobe in proxied]
    packed = np.zeros((len(rows), max(map(len, rows)), 4), np.float32)
    for row, filled in zip(rows, packed, strict=True):
        filled[: len(row)] = row
    ones = np.ones((NODES, NODES, 3), np.float32)
    ratio = np.concatenate([light.proxy_ratios.get(lobe.name, ones) for lobe in proxied], axis=1)
    part.arrays |= {
        "lights": encoded(np.stack([light.delta.directions, light.delta.irradiance], axis=1).astype(np.float32)),
        "proxies": encoded(packed),
        "ratio": encoded(np.pad(ratio.astype(np.float32), ((0, 0), (0, 0), (0, 1)))),
    }
    roughness = [proxy.alpha for lobe in lobes for proxy in lobe.proxies if proxy.alpha != LAMBERT]
    part.meta["narrowest"] = min(roughness, default=1.0)


def _proxy(lobe: LobeRecord) -> NDArray[np.float64]:
    """(α, is matte, glossy terms, 0), bare RGB0, coated RGB0, then for each term α and three colours; (packets, 4)."""
    matte, terms = np.zeros((2, 4)), list[NDArray[np.float64]]()
    for proxy in lobe.proxies:
        colours = np.array(proxy.coefficients, dtype=np.float64)
        if proxy.alpha == LAMBERT:
            matte[: len(colours), :3] += colours
        elif colours.any():
            term = np.zeros((1 + _COLOURS, 4))
            term[0, 0], term[1 : 1 + len(colours), :3] = proxy.alpha, colours
            terms.append(term)
    head = [[max(lobe.alpha, 0.0), float(lobe.alpha == LAMBERT), len(terms), 0.0]]
    return np.concatenate([head, matte, *terms])


def _four(values: NDArray[np.float64]) -> Encoded:
    """Values of shape (nodes, 3) with a fourth channel of zeros."""
    return encoded(np.pad(values, ((0, 0), (0, 1))).astype(np.float32))
