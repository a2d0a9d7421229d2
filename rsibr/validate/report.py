"""The report of a validation: one HTML page that holds all it shows, `metrics.json`, and the pictures as files."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

import rsibr
from rsibr.bake.atomic import unwritable, write_atomic
from rsibr.validate import pictures
from rsibr.validate.document import metrics_document
from rsibr.validate.estimate import Estimate, readable
from rsibr.validate.metrics import relative_noise_map
from rsibr.validate.pictures import FLIP, RELATIVE_ERROR, Rgba, Scale
from rsibr.validate.results import Validation, ViewResult

REPORT_NAME = "report.html"
METRICS_NAME = "metrics.json"
PICTURES_NAME = "pictures"

_LONGEST_EMBEDDED = 256
"""Texels a side that the page holds of each picture; the files in `pictures/` hold all."""


@dataclass(frozen=True, eq=False)
class _ViewPictures:
    """Pictures of one view: of each method by name, and of the reference."""

    reference: Rgba
    noise: Rgba
    images: dict[str, Rgba]
    errors: dict[str, Rgba]
    flips: dict[str, Rgba]

    def named(self, number: int) -> Iterator[tuple[str, Rgba]]:
        """File names and pictures."""
        yield f"view_{number:02d}_reference.png", self.reference
        yield f"view_{number:02d}_reference_noise.png", self.noise
        for kind, by_method in (("", self.images), ("_error", self.errors), ("_flip", self.flips)):
            for method, picture in by_method.items():
                yield f"view_{number:02d}_{method}{kind}.png", picture


def write_report(validation: Validation, directory: Path) -> Path:
    """Write the report, the metrics and the pictures.

    Parameters
    ----------
    validation : Validation
    directory : Path
        Made where missing. Files of an earlier report are replaced, each at once; the page comes last.

    Returns
    -------
    Path
        The page: `directory / "report.html"`.

    Raises
    ------
    BakeError, MachineError
        If the directory cannot be written.
    """
    drawn = _draw(validation)
    files = {name: picture for number, view in enumerate(drawn, 1) for name, picture in view.named(number)}
    folder = directory / PICTURES_NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for stale in folder.glob("view_[0-9][0-9]*_*.png"):
            if stale.name not in files:
                stale.unlink()
    except OSError as error:
        raise unwritable(folder, error) from error
    for name, picture in files.items():
        write_atomic(folder / name, pictures.png(picture))
    write_atomic(directory / METRICS_NAME, metrics_document(validation).to_json().encode())
    write_atomic(directory / REPORT_NAME, _page(validation, drawn).encode())
    return directory / REPORT_NAME


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
        )

    return [drawn(view) for view in validation.views]


def _page(validation: Validation, drawn: list[_ViewPictures]) -> str:
    environment = Environment(
        loader=PackageLoader("rsibr.validate", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters |= {
        "number": number,
        "estimate": estimate,
        "duration": duration,
        "size": size,
        "picture": _embedded,
    }
    environment.globals |= {"ticks": _ticks, "relative_error": RELATIVE_ERROR, "flip": FLIP}
    summary = validation.summary
    return environment.get_template("report.html.j2").render(
        validation=validation,
        document=metrics_document(validation),
        views=list(zip(validation.views, drawn, strict=True)),
        ranking=sorted(summary, key=lambda name: summary[name].rel_mse.value),
        bar=", ".join(pictures.bar_colours()),
        version=rsibr.__version__,
    )


def _embedded(picture: Rgba) -> str:
    return pictures.data_uri(pictures.shrunk(picture, _LONGEST_EMBEDDED))


def _ticks(scale: Scale) -> list[tuple[float, str]]:
    """Places on the bar in per cent, and their text."""
    return [(100 * float(scale.position(value)), text) for value, text in scale.ticks]


def number(value: float | None, digits: int = 3) -> str:
    """Write a number for a person, as `readable` does; a dash for None."""
    return "–" if value is None else _kept_together(readable(value, digits))


def estimate(value: Estimate) -> str:
    """Write an estimate with its interval for a person."""
    return _kept_together(str(value))


def duration(seconds: float) -> str:
    """Write a time for a person: `2.5 ms`, `12.3 s`, `3 min 20 s`, `2 h 05 min`."""
    if seconds < 1.0:
        return _kept_together(f"{readable(seconds * 1e3)} ms")
    if seconds < 60.0:
        return _kept_together(f"{readable(seconds)} s")
    minutes, rest = divmod(round(seconds), 60)
    long = f"{minutes // 60} h {minutes % 60:02d} min"
    return _kept_together(f"{minutes} min {rest:02d} s" if minutes < 60 else long)


def size(count: int) -> str:
    """Write a number of bytes for a person: `3.20 MiB`."""
    exponent = min(int(math.log2(count) // 10), 4) if count > 0 else 0
    return _kept_together(f"{readable(count / 1024**exponent)} {('B', 'KiB', 'MiB', 'GiB', 'TiB')[exponent]}")


def _kept_together(text: str) -> str:
    """Text that a line does not break within."""
    return text.replace(" ", "\u00a0")
