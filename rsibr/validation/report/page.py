"""Self-contained HTML pages from templates, with formatted numbers."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from rsibr.validation.estimate import Estimate, readable, with_uncertainty
from rsibr.validation.health.health import MARKS, SCALE
from rsibr.validation.report import pictures
from rsibr.validation.report.pictures import FLIP, RELATIVE_ERROR, Rgba, Scale
from rsibr.version import __version__

_LONGEST_EMBEDDED = 256
"""Maximum texels a side of the images in the page, unless a template says another; files in `pictures/` are whole."""

_THUMBNAIL = 64
"""The same of the small images that stand for a view in an index."""


def render(template: str, *, package: str = "", **values: Any) -> str:
    """Render a template.

    Parameters
    ----------
    template : str
        File name in `validation/report`, `validation/health` or the folder of `package`.
    package : str
        Another package whose folder holds templates.
    **values
        Variables of the template.

    Returns
    -------
    str
        Self-contained HTML.
    """
    packages = ["rsibr.validation.report", "rsibr.validation.health", *filter(None, [package])]
    loader = ChoiceLoader([PackageLoader(name, ".") for name in packages])
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    environment.filters |= {
        "number": number,
        "estimate": estimate,
        "brief": brief,
        "plus_minus": plus_minus,
        "duration": duration,
        "size": size,
        "picture": _embedded,
        "false_colour": partial(_embedded, exact=True),
        "thumbnail": partial(_embedded, longest=_THUMBNAIL),
    }
    environment.globals |= {
        "ticks": _ticks,
        "relative_error": RELATIVE_ERROR,
        "flip": FLIP,
        "marks": MARKS,
        "standard_error": SCALE,
        "bar": ", ".join(pictures.bar_colours()),
        "version": __version__,
    }
    return environment.get_template(template).render(**values)


def _embedded(picture: Rgba, longest: int = _LONGEST_EMBEDDED, *, exact: bool = False) -> str:
    return pictures.data_uri(pictures.shrunk(picture, longest), exact=exact)


def _ticks(scale: Scale) -> list[tuple[float, str]]:
    """Positions on the bar in per cent, and labels."""
    return [(100 * float(scale.position(value)), text) for value, text in scale.ticks]


def number(value: float | None, digits: int = 3) -> str:
    """Format a number as `readable` does; a dash for None."""
    return "–" if value is None else _kept_together(readable(value, digits))


def estimate(value: Estimate) -> str:
    """Format an estimate with its interval."""
    return _kept_together(str(value))


def brief(value: Estimate) -> str:
    """Format an estimate with two digits; below the noise floor as its upper limit: `< 0.0025`."""
    return _kept_together(f"< {readable(value.ci95[1], 2)}") if value.below_noise_floor else number(value.value, 2)


def plus_minus(value: Estimate) -> str:
    """Format a quantity that may be near zero, with half its interval: `0.0123 ± 0.0004`."""
    return _kept_together(with_uncertainty(value.value, (value.ci95[1] - value.ci95[0]) / 2))


def duration(seconds: float) -> str:
    """Format a time: `420 ns`, `2.5 ms`, `12.3 s`, `3 min 20 s`, `2 h 05 min`."""
    if 0 < seconds < 1e-5:
        return _kept_together(f"{readable(seconds * 1e9)} ns")
    if seconds < 1.0:
        return _kept_together(f"{readable(seconds * 1e3)} ms")
    if seconds < 60.0:
        return _kept_together(f"{readable(seconds)} s")
    minutes, rest = divmod(round(seconds), 60)
    long = f"{minutes // 60} h {minutes % 60:02d} min"
    return _kept_together(f"{minutes} min {rest:02d} s" if minutes < 60 else long)


def size(count: int) -> str:
    """Format a number of bytes: `3.20 MiB`."""
    exponent = min(int(math.log2(count) // 10), 4) if count > 0 else 0
    return _kept_together(f"{readable(count / 1024**exponent)} {('B', 'KiB', 'MiB', 'GiB', 'TiB')[exponent]}")


def _kept_together(text: str) -> str:
    """Replace spaces by non-breaking spaces."""
    return text.replace(" ", "\u00a0")
