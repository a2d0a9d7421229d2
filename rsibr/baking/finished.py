"""Test whether a bake is complete already, without planning, fitting or rendering."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import numpy as np

from rsibr import backend
from rsibr.errors import RsibrError
from rsibr.geometry.viewpoints import witness
from rsibr.regular_file import is_file
from rsibr.scene.config import Config, ViewsConfig
from rsibr.scene.environment import environment_digest
from rsibr.scene.material import material_digest
from rsibr.scene.python_plugins import load_plugins
from rsibr.scene.views import load_viewpoints
from rsibr.source_code import source_digest
from rsibr.store.bake import Bake, open_bake
from rsibr.store.manifest import MANIFEST_NAME, Manifest, read_manifest
from rsibr.store.soundness import fault_of
from rsibr.version import __version__

RECORDED = ("mitsuba", "drjit", "numpy", "OpenEXR", "rsibr")
"""Packages whose versions a manifest records."""

DECISIVE = ("mitsuba", "drjit", "rsibr")
"""Packages whose versions determine the bits of the maps."""

ROOMS = tuple(
    f"rsibr.{name}" for name in ("backend", "baking", "geometry", "light", "lobes", "planning", "scene", "store")
)
"""Modules of rsibr whose code determines the bits of the maps."""

SOURCE = "code of rsibr"
"""Key of the digest of `ROOMS` in the identity of a bake."""


def baking_code() -> str:
    """SHA-256 of the code that bakes: a version number does not change with every change of the code."""
    return source_digest(*ROOMS)


def package_versions() -> dict[str, str]:
    """Installed versions of the packages in `RECORDED`."""
    return {name: __version__ if name == "rsibr" else version(name) for name in RECORDED}


@backend.in_session
def finished_bake(config: Config, out: Path | str, digests: dict[str, str] | None = None) -> Bake | None:
    """Open the bake of a config if it is complete.

    Parameters
    ----------
    config : Config
        Config as given by the user.
    out : path
        Directory of the bake.
    digests : dict of str to str, optional
        Digests of "environment" and "material" if they are loaded already; by default those of their files.

    Returns
    -------
    Bake or None
        None if something is missing or damaged, or if the config, the content of the files that it names, the versions
        of the packages, the code of rsibr, or the device differ; or if its maps may be unusable as a whole
        (`rsibr.store.soundness`). `rsibr.baking.baker.bake` then reports the cause.
    """
    if not is_file(Path(out) / MANIFEST_NAME):
        return None
    try:
        found = open_bake(Path(out))
        sound = not fault_of(found.manifest, lambda: True)
        same = sound and _is_complete(found.manifest) and _is_of(found.manifest, config, digests)
    except RsibrError:
        return None
    return found if same else None


def _is_complete(manifest: Manifest) -> bool:
    """Whether everything that a bake records after its last view is there."""
    priced = manifest.plan is not None and manifest.plan.seconds is not None
    reached = manifest.budget is None or manifest.budget.reached_seconds is not None
    return priced and reached and manifest.light is not None


def _is_of(manifest: Manifest, config: Config, digests: dict[str, str] | None) -> bool:
    versions = package_versions()
    return (
        manifest.config == config.to_dict()
        and manifest.identity.get(SOURCE) == baking_code()
        and all(manifest.packages.get(name) == versions[name] for name in DECISIVE)
        and _device(manifest.variant) == _device(backend.use())
        and _has_views(manifest, config.views)
        and all(manifest.identity[kind]["content"] == digest for kind, digest in (digests or _digests(config)).items())
    )


def is_outdated(config: Config, out: Path | str) -> bool:
    """Whether `out` holds a bake of this config that other code or other versions of the packages made."""
    if not is_file(Path(out) / MANIFEST_NAME):
        return False
    try:
        manifest = read_manifest(Path(out) / MANIFEST_NAME)
    except RsibrError:
        return False
    versions = package_versions()
    current = all(manifest.packages.get(name) == versions[name] for name in DECISIVE)
    return manifest.config == config.to_dict() and not (current and manifest.identity.get(SOURCE) == baking_code())


def _digests(config: Config) -> dict[str, str]:
    load_plugins(config.plugin_modules)  # their source is part of the content
    return {"environment": environment_digest(config.environment), "material": material_digest(config.material)}


def _device(variant: str) -> str:
    return variant.partition("_")[0]


def _has_views(manifest: Manifest, views: ViewsConfig) -> bool:
    """Whether the config's file of views still holds the views of the bake; icosphere views are part of the config."""
    if views.file is None:
        return True
    every = load_viewpoints(views)
    baked = every if manifest.triangles else witness(every)
    return np.array_equal(baked.directions, np.array(manifest.directions))
