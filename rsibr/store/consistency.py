"""Consistency of a manifest with itself: whatever it holds twice, or that follows from the rest, is held against it.

A checksum tells damage from a whole file; it says nothing about a file that a stranger made. These checks need no file
but the manifest; `rsibr.store.map_header` holds the maps against it.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from rsibr.errors import BakeError, InputError, RsibrError
from rsibr.geometry.viewpoints import Viewpoints, from_directions, icosphere, witness
from rsibr.lobes.albedo import NODES
from rsibr.lobes.basis import COATED_FROM, LAMBERT, PLAIN_FROM
from rsibr.lobes.split import MIRROR
from rsibr.scene.config import Config, parse_config
from rsibr.store.capture import check_capture
from rsibr.store.manifest import LobeRecord, Manifest, ProxyRecord, ShapeRecord

BAKE_ANEW = "bake anew with --fresh"

_SAME_DIRECTION = 1e-9
_NARROWEST, _ROUGHEST = 1e-4, 2.0
_MOST_PROXIES, _MOST_GAUSSIANS = 32, 64
_WIDEST = 10.0  # standard deviation of slopes
_BRIGHTEST_ALBEDO, _LARGEST_COEFFICIENT = 100.0, 1e6
_CERTAINLY_GLOSSY = 0.35  # roughness below which a lobe of a built-in BSDF is no correction of a matte one


def check_manifest(manifest: Manifest, where: Path) -> None:
    """Check that the parts of a manifest fit together; `where` names its file in an error.

    Raises
    ------
    BakeError
        In one line, with the first part that does not fit.
    """
    try:
        if manifest.capture is not None:
            check_capture(manifest)
            return
        config = _config_of(manifest)
        _check_views(manifest, config)
        _check_resolution(manifest, config)
        _check_lobes(manifest, config)
        _check_identity(manifest)
    except ValueError as error:
        raise BakeError(f"is no valid manifest: {error}", where=str(where), fix=BAKE_ANEW) from error
    except RsibrError as error:
        what = f"is no valid manifest: {error.where}: {error.what}"
        raise BakeError(what, where=str(where), fix=BAKE_ANEW) from error


def _config_of(manifest: Manifest) -> Config:
    """Config by which the maps were rendered: that of the bake, or the one that its budget chose."""
    asked = _parsed(manifest.config, "config")
    if manifest.budget is None:
        _require(asked.budget is None, "config.budget: the manifest records no choice of a budget")
        return asked
    _require(manifest.budget.asked == manifest.config, "budget.asked: is not the config")
    resolved = _parsed(manifest.budget.resolved, "budget.resolved")
    scene = ("environment", "material", "effects", "plugins")
    same = all(getattr(asked, section) == getattr(resolved, section) for section in scene)
    _require(same and resolved.budget is None, "budget.resolved: is not what a budget makes of the config")
    return resolved


def _parsed(config: dict[str, object], place: str) -> Config:
    try:
        return parse_config(config, Path("/"))
    except InputError as error:
        raise InputError(error.what, where=place) from error


def _check_views(manifest: Manifest, config: Config) -> None:
    directions, triangles = np.array(manifest.directions, np.float64), manifest.triangles
    unit = np.abs(np.linalg.norm(directions, axis=1) - 1) < _SAME_DIRECTION
    _require(bool(unit.all()), f"directions.{np.argmin(unit)}: is no unit vector")
    if triangles:
        found = from_directions(directions, triangles)
        _require(_faces(found.triangles) == _faces(triangles), "triangles: not counter-clockwise seen from outside")
    else:
        _check_witness(manifest)
    if config.views.file is None:
        _check_icosphere(manifest, icosphere(config.views.level))


def _check_witness(manifest: Manifest) -> None:
    """A single map, without triangles, is enough where every lobe has a closed form."""
    count = len(manifest.directions)
    _require(count == 1, f"triangles: there are none, between {count} views")
    enough = bool(manifest.lobes) and manifest.plan is not None and not manifest.plan.needs_views
    _require(enough, "triangles: there are none, and the plan needs several views")


def _check_icosphere(manifest: Manifest, wanted: Viewpoints) -> None:
    wanted = wanted if manifest.triangles else witness(wanted)
    directions = np.array(manifest.directions, np.float64)
    same = len(directions) == len(wanted) and np.allclose(directions, wanted.directions, rtol=0.0, atol=_SAME_DIRECTION)
    _require(bool(same), f"directions: are not the {len(wanted)} views that the config asks for")
    _require(
        _faces(manifest.triangles) == _faces(wanted.triangles), "triangles: are not those of the config's icosphere"
    )


def _faces(triangles: Iterable[Iterable[int]]) -> list[tuple[int, ...]]:
    """Triangles in an order that does not depend on theirs, each from its least corner on."""
    faces = [tuple(map(int, triangle)) for triangle in triangles]
    return sorted(face[least:] + face[:least] for face in faces for least in [face.index(min(face))])


def _check_resolution(manifest: Manifest, config: Config) -> None:
    resolution, plan = manifest.resolution, manifest.plan
    _require(resolution <= config.map.side, f"resolution: {resolution}, above map.resolution = {config.map.side}")
    if plan is not None:
        _require(plan.resolution == resolution, f"resolution: {resolution}, but {plan.resolution} in the plan")
        costs = (plan.seconds, plan.bytes, plan.probe_seconds)
        _require(all(0 <= cost < 1e18 for cost in costs if cost is not None), "plan: a cost is out of range")
        names = [effect.name for effect in plan.effects]
        _require(len(set(names)) == len(names), "plan.effects: two share a name")
    elif config.map.resolution != "auto":
        _require(resolution == config.map.side, f"resolution: {resolution}, but {config.map.side} in the config")
    rendering = "rgb" if plan is None else plan.rendering
    _require(manifest.variant.endswith(f"_{rendering}"), f"variant: {manifest.variant} does not render {rendering}")


def _check_lobes(manifest: Manifest, config: Config) -> None:
    for place, lobe in enumerate(manifest.lobes):
        _check_lobe(lobe, f"lobes.{place} ({lobe.name})")
    if manifest.plan is not None:
        planned = {lobe.name: lobe.own_views for lobe in manifest.plan.lobes}
        for lobe in manifest.lobes:
            known = lobe.name in planned and planned[lobe.name] == lobe.views
            _require(known, f"lobes: {lobe.name} is not as planned")
            _require(lobe.name not in manifest.plan.left_out, f"lobes: {lobe.name} is left out by the plan")
    _check_warp(manifest, config)


def _check_lobe(lobe: LobeRecord, place: str) -> None:
    albedo = np.array(lobe.albedo, np.float64)
    _require(len(albedo) == NODES, f"{place}.albedo: {len(albedo)} angles, not {NODES}")
    within = (albedo >= 0.0) & (albedo <= _BRIGHTEST_ALBEDO)
    _require(bool(within.all()), f"{place}.albedo: out of range")
    if not lobe.proxies:
        _require(lobe.alpha == MIRROR, f"{place}.proxies: there are none, and it is no delta lobe")
        _require(lobe.shape is None, f"{place}.shape: is not that of a delta lobe")
        return
    alphas = [proxy.alpha for proxy in lobe.proxies]
    _require(len(alphas) <= _MOST_PROXIES and len(set(alphas)) == len(alphas), f"{place}.proxies: too many, or alike")
    for number, proxy in enumerate(lobe.proxies):
        _check_proxy(proxy, f"{place}.proxies.{number}")
    if lobe.shape is not None:
        _check_shape(lobe.shape, f"{place}.shape")
    low, high = (LAMBERT, LAMBERT) if LAMBERT in alphas else (min(alphas), max(alphas))
    _require(low * (1 - 1e-6) <= lobe.alpha <= high * (1 + 1e-6), f"{place}.alpha: is not that of its proxies")


def _check_shape(shape: ShapeRecord, place: str) -> None:
    _require(0.0 < shape.alpha <= 1.0, f"{place}.alpha: {shape.alpha:g} is no roughness")
    for name, mixture in (("bare", shape.bare), ("coated", shape.coated)):
        sigmas = np.array([one.sigma for one in mixture])
        sound = len(mixture) <= _MOST_GAUSSIANS and bool((np.diff(sigmas, prepend=0.0) > 0.0).all())
        _require(sound, f"{place}.{name}: too many Gaussians, or not in order of their widths")
        _require(
            bool((sigmas >= _NARROWEST).all() and (sigmas <= _WIDEST).all()), f"{place}.{name}: width out of range"
        )
        weights = np.array([(one.plain, one.grazing) for one in mixture])
        within = (weights >= 0.0) & (weights <= _LARGEST_COEFFICIENT)
        _require(bool(within.all()), f"{place}.{name}: weights out of range")
    matte = np.array(shape.matte)
    within = (matte >= 0.0) & (matte <= _LARGEST_COEFFICIENT)
    _require(bool(within.all()), f"{place}.matte: out of range")


def _check_proxy(proxy: ProxyRecord, place: str) -> None:
    sound = proxy.alpha == LAMBERT or _NARROWEST <= proxy.alpha <= _ROUGHEST
    _require(sound, f"{place}.alpha: {proxy.alpha:g} is no roughness")
    terms = 1 if proxy.alpha > PLAIN_FROM else 3 if proxy.alpha >= COATED_FROM else 2
    _require(len(proxy.coefficients) == terms, f"{place}.coefficients: {len(proxy.coefficients)} terms, not {terms}")
    values = np.array(proxy.coefficients, np.float64)
    within = (values >= 0.0) & (values <= _LARGEST_COEFFICIENT)
    _require(bool(within.all()), f"{place}.coefficients: out of range")


def _check_warp(manifest: Manifest, config: Config) -> None:
    warp = manifest.material.warp
    if config.material.warp != "auto":
        _require(warp == config.material.warp, f"material.warp: {warp}, but {config.material.warp} in the config")
    elif not config.plugin_modules:  # a plugin may have flags of its own
        glossy = any(lobe.alpha == MIRROR or 0 < lobe.alpha < _CERTAINLY_GLOSSY for lobe in manifest.lobes)
        _require(warp == "mirror" or not glossy, "material.warp: normal, though a lobe is glossy")


def _check_identity(manifest: Manifest) -> None:
    """The identity repeats what fixes the bits of the maps; parts that an older bake lacks are not asked for."""
    identity = manifest.identity
    for kind, name in (("environment", manifest.environment.name), ("material", manifest.material.name)):
        part = identity.get(kind)
        if not isinstance(part, dict) or not isinstance(part.get("content"), str):
            raise ValueError(f"identity.{kind}.content: is missing")
        _require(part.get("name", name) == name, f"identity.{kind}.name: is not that of the {kind}")
    packages = identity.get("packages", {})
    same = isinstance(packages, dict) and packages.items() <= manifest.packages.items()
    _require(same, "identity.packages: are not those of the bake")
    repeated = {
        "variant": manifest.variant,
        "blocks": manifest.sampling.identity if manifest.sampling else identity.get("blocks"),
        "lobe_views": {lobe.name: lobe.views for lobe in manifest.lobes if lobe.views is not None},
    }
    if not manifest.lobes:
        del repeated["lobe_views"]
    for key, value in repeated.items():
        _require(identity.get(key, value) == value, f"identity.{key}: is not that of the bake")


def _require(condition: bool, what: str) -> None:
    if not condition:
        raise ValueError(what)
