"""Material: a preset, a Mitsuba BSDF as plain data, or a Mitsuba XML file; opaque and homogeneous."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import mitsuba as mi

from rsibr import backend
from rsibr.errors import InputError
from rsibr.regular_file import is_file
from rsibr.scene.config import MaterialConfig
from rsibr.scene.delta_direction import require_plain_mirror
from rsibr.scene.mitsuba_bsdf import BsdfSource, bsdf_digest, load_bsdf
from rsibr.scene.plugin import require_files
from rsibr.scene.presets import preset_file
from rsibr.scene.trial import require_survival, warn_untried

VARYING = "varies over the surface: lobes are those of one place; expect larger errors between the stored views"

ANISOTROPIC = "anisotropic: sphere maps hold one radiance a normal; expect larger errors between the views"


@dataclass(frozen=True)
class Material:
    """Validated material. Made by `load_material`.

    Attributes
    ----------
    name : str
        Name of the preset, type of the BSDF, or stem of the XML file.
    digest : str
        SHA-256 of the content, independent of file names.
    warp : {"mirror", "normal"}
        Direction by which its maps are indexed when warped as one lobe: the mirror direction or the surface normal.
    notes : tuple of str
        Properties that maps cannot represent, for bakes and reports.
    """

    name: str
    digest: str
    warp: Literal["mirror", "normal"]
    notes: tuple[str, ...]
    _source: BsdfSource = field(repr=False)
    _where: str = field(repr=False, compare=False)

    def bsdf(self) -> mi.BSDF:
        """Load the BSDF in the current variant."""
        return load_bsdf(self._source, self._where)


def load_material(config: MaterialConfig) -> Material:
    """Load and validate a material.

    Parameters
    ----------
    config : MaterialConfig
        A preset, a BSDF or a file, and the warp.

    Raises
    ------
    InputError
        If the preset or the file does not exist, Mitsuba rejects the BSDF (see `rsibr.scene.mitsuba_bsdf.load_bsdf`),
        or the BSDF transmits light.
    """
    backend.use()
    name, source, where = _source_of(config)
    untried = require_survival(config, where) if config.preset is None else ""
    bsdf = load_bsdf(source, where)
    warn_untried(untried)
    _require_opaque(bsdf, name, where)
    if config.preset is None:
        require_plain_mirror(bsdf, name, where)
    warp = _natural_warp(bsdf) if config.warp == "auto" else config.warp
    return Material(name, bsdf_digest(source, where), warp, _notes(bsdf), source, where)


def material_digest(config: MaterialConfig) -> str:
    """Digest of the content as `load_material` finds it; Mitsuba parses the files and loads nothing.

    Raises
    ------
    InputError
        If a file is gone or is no XML.
    """
    backend.use()
    _, source, where = _source_of(config)
    return bsdf_digest(source, where)


def _notes(bsdf: mi.BSDF) -> tuple[str, ...]:
    if mi.has_flag(bsdf.flags(), mi.BSDFFlags.Anisotropic):
        return (ANISOTROPIC,)
    return ()


def _source_of(config: MaterialConfig) -> tuple[str, BsdfSource, str]:
    if config.preset is not None:
        path = preset_file(config.preset)
        return config.preset, path, str(path)
    if config.bsdf is not None:
        require_files(config.bsdf, "material.bsdf")
        return str(config.bsdf["type"]), config.bsdf, "material.bsdf"
    path = Path(config.file or "")
    if not is_file(path):
        raise InputError("there is no such material file", where=str(path), fix="check the path")
    return path.stem, path, str(path)


def _require_opaque(bsdf: mi.BSDF, name: str, where: str) -> None:
    if mi.has_flag(bsdf.flags(), mi.BSDFFlags.Transmission):  # Null counts as transmission
        raise InputError(
            f"'{name}' lets light through, and the sphere that is rendered is opaque",
            where=where,
            fix="use a BSDF that only reflects",
        )


def _natural_warp(bsdf: mi.BSDF) -> Literal["mirror", "normal"]:
    flags = mi.BSDFFlags
    shiny = mi.has_flag(bsdf.flags(), flags.Glossy) or mi.has_flag(bsdf.flags(), flags.Delta)
    return "mirror" if shiny else "normal"
