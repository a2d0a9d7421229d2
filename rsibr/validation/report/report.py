"""Report of a validation: one self-contained HTML page, `metrics.json`, references as maps, and images as files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.methods.method_name import file_stem
from rsibr.methods.registry import baseline_method
from rsibr.store.atomic import unwritable, write_atomic
from rsibr.store.directory import make_own_folder
from rsibr.validation.health.health_report import write_health_pictures
from rsibr.validation.lobes import ViewLobes
from rsibr.validation.metrics import relative_noise_map
from rsibr.validation.report import pictures
from rsibr.validation.report.document import metrics_document
from rsibr.validation.report.page import render
from rsibr.validation.report.pictures import FLIP, RELATIVE_ERROR, Rgba
from rsibr.validation.report.references import write_references
from rsibr.validation.results import Validation, ViewResult

REPORT_NAME = "report.html"
METRICS_NAME = "metrics.json"
PICTURES_NAME = "pictures"

_MOST_VIEWS = 24
"""Maximum number of views whose pictures are in the page: with nine methods, ¼ MiB each at 160² texels."""


@dataclass(frozen=True, eq=False)
class _LobePictures:
    """Images of one lobe at one view."""

    reference: Rgba
    image: Rgba
    error: Rgba


@dataclass(frozen=True, eq=False)
class _ViewPictures:
    """Images of one view: of the reference, of each method by name, and of each lobe by name."""

    reference: Rgba
    noise: Rgba
    images: dict[str, Rgba]
    errors: dict[str, Rgba]
    flips: dict[str, Rgba]
    lobes: dict[str, _LobePictures]

    def named(self, number: int) -> Iterator[tuple[str, Rgba]]:
        """Yield file names and images."""
        yield _file_name(number, "reference"), self.reference
        yield _file_name(number, "reference_noise"), self.noise
        for kind, by_method in (("", self.images), ("_error", self.errors), ("_flip", self.flips)):
            for method, picture in by_method.items():
                yield _file_name(number, method + kind), picture
        for lobe, drawn in self.lobes.items():
            for kind, picture in vars(drawn).items():
                yield _file_name(number, f"lobe_{lobe}_{kind}"), picture


def _file_name(number: int, of: str) -> str:
    """Name of an image of a view in `pictures/`."""
    return f"view_{number:02d}_{file_stem(of)}.png"


def write_report(validation: Validation, directory: Path) -> Path:
    """Write report, metrics and images.

    Parameters
    ----------
    validation : Validation
        Result of a validation.
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
    files = {name: picture for number, view in enumerate(drawn, 1) for name, picture in view.named(number)}
    write_pictures(directory, "view_[0-9][0-9]*_*.png", files)
    write_references(validation, directory)
    if validation.health is not None:
        write_health_pictures(validation.health, directory)
    write_atomic(directory / METRICS_NAME, metrics_document(validation).to_json().encode())
    write_atomic(directory / REPORT_NAME, _page(validation, drawn).encode())
    return directory / REPORT_NAME


def write_pictures(directory: Path, pattern: str, files: Mapping[str, Rgba]) -> None:
    """Write the images of a report by file name; those of an earlier report that match `pattern` are removed.

    Raises
    ------
    BakeError, MachineError
        If it cannot be written.
    """
    folder = directory / PICTURES_NAME
    try:
        make_own_folder(folder)
        for stale in folder.glob(pattern):
            if stale.name not in files:
                stale.unlink()
    except OSError as error:
        raise unwritable(folder, error) from error
    for name, picture in files.items():
        write_atomic(folder / name, pictures.png(picture))


def _draw(validation: Validation) -> list[_ViewPictures]:
    exposure = pictures.display_exposure([view.reference for view in validation.views])

    def drawn(view: ViewResult) -> _ViewPictures:
        coverage, methods = view.reference.coverage, view.methods.items()
        return _ViewPictures(
            reference=pictures.tone_mapped(view.reference.mean, coverage, exposure),
            noise=pictures.false_colour(relative_noise_map(view.reference), RELATIVE_ERROR),
            images={name: pictures.tone_mapped(result.image, coverage, exposure) for name, result in methods},
            errors={n: pictures.false_colour(result.error.relative_error, RELATIVE_ERROR) for n, result in methods},
            flips={name: pictures.false_colour(result.error.flip_map, FLIP) for name, result in methods},
            lobes={} if view.lobes is None else lobes(view.lobes, coverage),
        )

    def lobes(found: ViewLobes, coverage: NDArray[np.float32]) -> dict[str, _LobePictures]:
        return {
            name: _LobePictures(
                reference=pictures.tone_mapped(lobe.reference, coverage, exposure),
                image=pictures.tone_mapped(lobe.image, coverage, exposure),
                error=pictures.false_colour(lobe.relative_error, RELATIVE_ERROR),
            )
            for name, lobe in found.errors.items()
        }

    return [drawn(view) for view in validation.views]


@dataclass(frozen=True, eq=False)
class _ShownView:
    """A view in the page: its number among all, results and images."""

    number: int
    result: ViewResult
    drawn: _ViewPictures

    @property
    def id(self) -> str:
        """Name in the page."""
        return f"view-{self.number}"

    def file(self, of: str) -> str:
        """Path of the whole image, from the page."""
        return f"{PICTURES_NAME}/{_file_name(self.number, of)}"


def _page(validation: Validation, drawn: list[_ViewPictures]) -> str:
    summary = validation.summary
    ranking = sorted(summary, key=lambda name: summary[name].rel_mse.value)
    views = [_ShownView(n, *one) for n, one in enumerate(zip(validation.views, drawn, strict=True), 1)]
    worst_first = sorted(views, key=lambda one: -one.result.methods[ranking[0]].error.rel_mse.value)
    return render(
        "report.html.j2",
        validation=validation,
        document=metrics_document(validation),
        views=sorted(worst_first[:_MOST_VIEWS], key=lambda one: one.number),
        ranking=ranking,
        rivals=[name for name in dict.fromkeys([*ranking[1:2], baseline_method()]) if name in ranking[1:]],
        ordered=[ranking[0], *(name for name in summary if name != ranking[0])],
        titles={name: one.title for name, one in validation.lobe_summary.items()},
        health=validation.health,
        plan=validation.plan,
    )
