"""Report of an object's validation: one self-contained HTML page, `object.json`, and images as files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rsibr.methods.method_name import file_stem
from rsibr.store.atomic import write_atomic
from rsibr.validation.metrics import relative_noise_map
from rsibr.validation.objects import zones as definitions
from rsibr.validation.objects.results import ObjectValidation
from rsibr.validation.report import pictures
from rsibr.validation.report.object_document import object_document
from rsibr.validation.report.page import render
from rsibr.validation.report.pictures import FLIP, RELATIVE_ERROR, Rgba
from rsibr.validation.report.report import PICTURES_NAME, REPORT_NAME, write_pictures

OBJECT_METRICS_NAME = "object.json"

_ZONE_COLOURS = {"silhouette": (200, 60, 40), "curved": (60, 110, 180), "flat": (170, 170, 170)}


def write_object_report(validation: ObjectValidation, directory: Path) -> Path:
    """Write report, metrics and images.

    Parameters
    ----------
    validation : ObjectValidation
        Result of an object's validation.
    directory : Path
        Created if it does not exist. Files of an earlier report are replaced atomically, the page last.

    Returns
    -------
    Path
        Path of the page, `directory / "report.html"`.

    Raises
    ------
    BakeError, MachineError
        If the directory cannot be written.
    """
    drawn = _draw(validation)
    files = {_file_name(name): picture for name, picture in drawn.items()}
    write_pictures(directory, "object_*.png", files)
    document = object_document(validation)
    write_atomic(directory / OBJECT_METRICS_NAME, document.to_json().encode())
    page = render(
        "object.html.j2",
        validation=validation,
        document=document,
        drawn=drawn,
        file=lambda of: f"{PICTURES_NAME}/{_file_name(of)}",
        ordered=[validation.best, *(name for name in validation.methods if name != validation.best)],
        definitions=definitions,
        zone_colours={name: "#{:02x}{:02x}{:02x}".format(*colour) for name, colour in _ZONE_COLOURS.items()},
    )
    write_atomic(directory / REPORT_NAME, page.encode())
    return directory / REPORT_NAME


def _file_name(of: str) -> str:
    """Name of an image in `pictures/`."""
    return f"object_{file_stem(of)}.png"


def _draw(validation: ObjectValidation) -> dict[str, Rgba]:
    """Images by name: truths, their noise, zones, and of each method picture, errors and FLIP."""
    truths = validation.truths
    exposure = pictures.display_exposure([truths.open])
    drawn = {"zones": _zones(validation)}
    for name in ("open", "shadowed", "full"):
        truth = truths.named[name]
        drawn[name] = pictures.tone_mapped(truth.mean, truth.coverage, exposure)
        drawn[f"{name}_noise"] = pictures.false_colour(relative_noise_map(truth), RELATIVE_ERROR)
    for name, made in validation.methods.items():
        for against, picture in (("open", made.bare), ("full", made.picture)):
            radiance = picture.radiance / np.maximum(picture.alpha, np.finfo(np.float32).tiny)[..., None]
            drawn[f"{name}_{against}"] = pictures.tone_mapped(radiance, picture.alpha, exposure)
        for against, error in (("open", made.open), ("full", made.full)):
            drawn[f"{name}_{against}_error"] = pictures.false_colour(error.relative_error, RELATIVE_ERROR)
            drawn[f"{name}_{against}_flip"] = pictures.false_colour(error.flip_map, FLIP)
    return drawn


def _zones(validation: ObjectValidation) -> Rgba:
    picture = np.zeros((*validation.truths.open.coverage.shape, 4), dtype=np.uint8)
    for name, inside in validation.zones.items():
        picture[inside] = (*_ZONE_COLOURS[name], 255)
    return picture
