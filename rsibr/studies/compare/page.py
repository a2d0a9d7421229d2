"""The page of a comparison: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from rsibr.methods.address import is_address
from rsibr.methods.registry import registration, registrations
from rsibr.studies.compare import figures
from rsibr.studies.compare.budgets import COSTS, BestRecord, ClassRecord, MeanRecord, WinnerRecord, unit_of
from rsibr.studies.compare.document import CompareDocument
from rsibr.studies.compare.pictures import ScenePictures
from rsibr.studies.compare.records import ComparedScene
from rsibr.studies.figures import svg_uri
from rsibr.studies.page import estimate
from rsibr.validation.estimate import readable
from rsibr.validation.report.page import duration, render, size

COST_NAMES = {
    "once_seconds": "time before the first map",
    "bytes": "memory on the device",
    "frame_seconds": "time of a map",
}


@dataclass(frozen=True, eq=False)
class _ShownClass:
    """A class with its figure and its systems in display order."""

    record: ClassRecord
    fronts: str
    systems: list[str]


def compare_page(document: CompareDocument, pictures: Sequence[ScenePictures]) -> str:
    """Write the page.

    Parameters
    ----------
    document : CompareDocument
    pictures : sequence of ScenePictures
        One a scene, in their order.

    Returns
    -------
    str
        HTML that refers to nothing outside itself.
    """
    colours = figures.colours_of(document.systems)
    return render(
        "compare.html.j2",
        package="rsibr.studies.compare",
        document=document,
        headline=svg_uri(figures.headline(document.classes, colours)),
        answers=[(record, answers(record)) for record in document.classes],
        classes=[_shown(record, document, colours) for record in document.classes],
        scenes=list(zip(document.scenes, pictures, strict=True)),
        summaries={name: _summary(name) for name in document.systems},
        costs=COST_NAMES,
        amount=amount,
        told=estimate,
        shown=shown,
        on_front=on_front,
    )


def answers(record: ClassRecord) -> list[str]:
    """Describe in one sentence for each cost which system has the least error from which budget on."""
    return [f"{COST_NAMES[cost]}: {_sequence(record.winners[cost], cost)}" for cost in COSTS if record.winners[cost]]


def amount(value: float, cost: str) -> str:
    """Format an amount of a cost."""
    return size(round(value)) if unit_of(cost) == "B" else duration(value)


def shown(one: MeanRecord | WinnerRecord | BestRecord) -> str:
    """Error of a setting, or its upper limit."""
    return ("< " if one.is_bound else "") + readable(one.rel_mse, 2)


def on_front(scene: ComparedScene, label: str) -> bool:
    """Whether a setting has the least error of its system on a scene."""
    return any(one.label == label for one in scene.best().values())


def _summary(system: str) -> str:
    if system in registrations() or is_address(system):
        return registration(system).summary
    return "external maps"


def _sequence(winners: Sequence[WinnerRecord], cost: str) -> str:
    """Winners in turn; settings of one system that follow each other are told together."""
    return ", then ".join(_run([*run], cost) for _, run in groupby(winners, key=lambda one: one.system))


def _run(winners: Sequence[WinnerRecord], cost: str) -> str:
    first, last = winners[0], winners[-1]
    error = shown(first)
    if len(winners) > 1:
        error = f"{error}, {shown(last)} from {amount(last.budget, cost)}"
    level = f"; level with {' and '.join(last.level_with)}" if last.level_with else ""
    name = first.label if len(winners) == 1 else first.system
    return f"{name} from {amount(first.budget, cost)} (relMSE {error}{level})"


def _shown(record: ClassRecord, document: CompareDocument, colours: dict[str, str]) -> _ShownClass:
    present = {one.system for one in record.means}
    systems = [name for name in document.systems if name in present]
    return _ShownClass(record, svg_uri(figures.fronts(record, colours)), systems)
