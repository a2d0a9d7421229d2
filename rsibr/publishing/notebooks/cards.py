"""Cards: small pictures and key numbers, in which a notebook shows a bake, a map or the results of a validation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from rsibr.methods.reconstruction import Reconstruction
from rsibr.publishing.notebooks.colours import of_maps
from rsibr.store.bake import Bake
from rsibr.store.png_file import Rgba, exposure_of, tone_mapped
from rsibr.studies.runner import Study
from rsibr.validation.report.page import duration, estimate, size
from rsibr.validation.report.pictures import RELATIVE_ERROR, data_uri, display_exposure, false_colour, shrunk
from rsibr.validation.results import Validation

_SIDE = 96
_MOST_PICTURES = 6

_CARD = "display:inline-block;border:1px solid #8884;border-radius:6px;padding:10px 14px;max-width:46rem"
_FAINT = "color:#888;font-size:90%"


def bake_card(bake: Bake) -> str:
    """Card of a bake: some of its maps, and what it cost."""
    chosen = np.unique(np.linspace(0, bake.view_count - 1, min(bake.view_count, _MOST_PICTURES)).astype(int))
    maps = [bake.map(int(index)) for index in chosen]
    pictures = [(picture, f"view {index}") for picture, index in zip(of_maps(maps), chosen, strict=True)]
    told = bake.manifest
    views = f"{bake.view_count} views of {bake.resolution}²" if bake.has_views else "no stored views"
    facts = [views, f"{told.samples} samples a texel", size(bake.bytes), f"baked in {duration(bake.seconds)}"]
    return _card(f"{told.material.name} under {told.environment.name}", facts, pictures)


def map_card(made: Reconstruction) -> str:
    """Card of a reconstructed map."""
    judged = made.image[made.coverage >= 0.5].max(axis=-1)
    picture = tone_mapped(made.image, made.coverage, exposure_of(judged))
    view = ", ".join(f"{x:+.2f}" for x in made.view)
    facts = [f"{len(made.image)}²", f"made in {duration(made.seconds)}"]
    return _card(f"{made.method}, view ({view})", facts, [(picture, "")])


def validation_card(validation: Validation) -> str:
    """Card of a validation: each method's error and time, and relative errors of the best at the first view."""
    first, methods = validation.views[0], validation.methods
    exposure = display_exposure([first.reference])
    pictures = [(tone_mapped(first.reference.mean, first.reference.coverage, exposure), "reference")]
    best = sorted(methods, key=lambda name: validation.summary[name].rel_mse.value)[: _MOST_PICTURES - 1]
    for name in best:
        error = first.methods[name].error.relative_error
        pictures.append((false_colour(error, RELATIVE_ERROR), name))
    summary = validation.summary
    rows = [(name, estimate(summary[name].rel_mse), duration(summary[name].seconds)) for name in methods]
    bake = validation.bake
    count = len(validation.views)
    facts = [
        f"{count} novel view{'s' * (count > 1)}",
        f"bake of {bake.views} views of {bake.resolution}²",
        "pictures: relative errors, 0.1 % to 100 %",
    ]
    table = _table(("method", "relMSE", "time a map"), rows)
    return _card(f"{bake.material} under {bake.environment}", facts, pictures, table)


def study_card(study: Study) -> str:
    """Card of a study: its best point of each scene."""
    document = study.document
    rows = []
    for scene in document.scenes:
        for point in sorted(scene.points, key=lambda one: one.rel_mse)[:1]:
            rows.append((scene.name, point.label, f"{point.rel_mse:.2g}", duration(point.frame_seconds.median)))
    scenes, points = len(document.scenes), sum(len(scene.points) for scene in document.scenes)
    counts = [f"{scenes} scene{'s' * (scenes > 1)}", f"{points} point{'s' * (points > 1)}"]
    facts = [*counts, f"measured in {duration(document.seconds)}"]
    table = _table(("scene", "least error", "relMSE", "time a picture"), rows)
    return _card(f"Study {document.name}", facts, [], table)


def _card(title: str, facts: Iterable[str], pictures: Sequence[tuple[Rgba, str]], below: str = "") -> str:
    figures = "".join(_figure(picture, caption) for picture, caption in pictures)
    told = escape(" · ".join(facts))
    return (
        f'<div style="{_CARD}"><div><b>{escape(title)}</b></div><div style="{_FAINT}">{told}</div>'
        f'<div style="display:flex;flex-wrap:wrap;gap:8px;margin-top:6px">{figures}</div>{below}</div>'
    )


def _figure(picture: Rgba, caption: str) -> str:
    image = f'<img src="{data_uri(shrunk(picture, _SIDE))}" alt="{escape(caption or "map")}" width="{_SIDE}">'
    return f'<div style="text-align:center;{_FAINT}">{image}<br>{escape(caption)}</div>'


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(one)}</th>" for one in heads)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f'<table style="margin-top:6px"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
