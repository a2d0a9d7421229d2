"""Whether a bake is there already, whole: found out without planning, fitting or rendering anything."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import numpy as np

from rsibr import backend
from rsibr.errors import RsibrError
from rsibr.geometry.viewpoints import witness
from rsibr.scene.config import Config, ViewsConfig
from rsibr.scene.environment import environment_digest
from rsibr.scene.material import material_digest
from rsibr.scene.python_plugins import load_plugins
from rsibr.scene.views import load_viewpoints
from rsibr.store.bake import Bake, open_bake
from rsibr.store.manifest import MANIFEST_NAME, Manifest
from rsibr.version import __version__

RECORDED = ("mitsuba", "drjit", "numpy", "OpenEXR", "rsibr")
"""Packages whose versions a manifest holds."""

DECISIVE = ("mitsuba", "drjit", "rsibr")
"""Those of them that fix the bits of the maps."""


def package_versions() -> dict[str, str]:
    """Versions of the packages that a bake is made with."""
    return {name: __version__ if name == "rsibr" else version(name) for name in RECORDED}


@backend.in_session
def finished_bake(config: Config, out: Path | str, digests: dict[str, str] | None = None) -> Bake | None:
    """Open the bake of a config where it is complete.

    Parameters
    ----------
    config : Config
        As it was asked for.
    out : path
        Directory of the bake.
    digests : dict of str to str, optional
        Digests of "environment" and "material" where they are loaded already; by default those of their files.

    Returns
    -------
    Bake or None
        None where something is missing, damaged, or differs: in the config, in the content of the files that it names,
        in the versions of the packages, or in the device. What it is, a bake finds out and says.
    """
    if not (Path(out) / MANIFEST_NAME).is_file():
        return None
    try:
        found = open_bake(Path(out))
        same = _is_complete(found.manifest) and _is_of(found.manifest, config, digests)
    except RsibrError:
        return None
    return found if same else None


def _is_complete(manifest: Manifest) -> bool:
    """Whether all is recorded that a bake records after its last view."""
    priced = manifest.plan is not None and manifest.plan.seconds is not None
    reached = manifest.budget is None or manifest.budget.reached_seconds is not None
    return priced and reached and manifest.light is not None


def _is_of(manifest: Manifest, config: Config, digests: dict[str, str] | None) -> bool:
    versions = package_versions()
    return (
        manifest.config == config.to_dict()
        and all(manifest.packages.get(name) == versions[name] for name in DECISIVE)
        and _device(manifest.variant) == _device(backend.use())
        and _has_views(manifest, config.views)
        and all(manifest.identity[kind]["content"] == digest for kind, digest in (digests or _digests(config)).items())
    )


def _digests(config: Config) -> dict[str, str]:
    load_plugins(config.plugin_modules)  # their source is part of the content
    return {"environment": environment_digest(config.environment), "material": material_digest(config.material)}


def _device(variant: str) -> str:
    return variant.partition("_")[0]


def _has_views(manifest: Manifest, views: ViewsConfig) -> bool:
    """Whether a file of views still holds those of the bake; those of an icosahedron are in the config."""
    if views.file is None:
        return True
    every = load_viewpoints(views)
    baked = every if manifest.triangles else witness(every)
    return np.array_equal(baked.directions, np.array(manifest.directions))
