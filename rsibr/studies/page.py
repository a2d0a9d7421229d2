"""The page of a study: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from rsibr.methods.registry import baseline_method
from rsibr.studies import figures
from rsibr.studies.analysis import SceneAnalysis, SlopeRecord
from rsibr.studies.classes import GainRecord, PairRecord
from rsibr.studies.document import StudyDocument
from rsibr.studies.doubling import DoublingRecord
from rsibr.studies.results import PointRecord, SceneRecord
from rsibr.validation.estimate import readable
from rsibr.validation.report.estimate_document import EstimateModel
from rsibr.validation.report.page import duration, number, size
from rsibr.validation.report.pictures import bar_colours
from rsibr.version import __version__

_MOST_SHOWN = 12
"""Largest number of points in the figure of the composition of the error."""


@dataclass(frozen=True, eq=False)
class _Shown:
    """A scene with its analysis and figures."""

    scene: SceneRecord
    analysis: SceneAnalysis
    convergence: str
    fronts: str
    whereabouts: str

    @property
    def on_front(self) -> dict[str, list[str]]:
        """Names of the costs on whose front a point lies, by label."""
        names = {"once_seconds": "start", "bytes": "bytes", "frame_seconds": "picture"}
        return {
            point.label: [names[cost] for cost, front in self.analysis.fronts.items() if point.label in front.on]
            for point in self.scene.points
        }

    @property
    def best(self) -> PointRecord:
        """The point with the least error."""
        return min(self.scene.points, key=lambda point: point.rel_mse)

    def instead(self, label: str) -> str:
        """Point that dominates this one in the time before the first picture; empty on the front."""
        return self.analysis.fronts["once_seconds"].dominated.get(label, "")


@dataclass(frozen=True, eq=False)
class Drawn:
    """The figures of a page; drawing them takes nearly all of its time.

    Attributes
    ----------
    headline : str
        The first figure, as a data URI; empty where only errors are judged.
    scenes : list
        Each scene with its figures; the same.
    """

    headline: str
    scenes: list[_Shown]

    @classmethod
    def of(cls, document: StudyDocument) -> Drawn:
        """Draw the figures of a study."""
        headline = figures.svg_uri(figures.headline(document)) if document.analysed else ""
        return cls(headline, [_shown(scene, analysis) for scene, analysis in document.analysed])


def study_page(document: StudyDocument, drawn: Drawn) -> str:
    """Write the page.

    Parameters
    ----------
    document : StudyDocument
    drawn : Drawn
        Its figures.

    Returns
    -------
    str
        HTML that refers to nothing outside itself.
    """
    loader = ChoiceLoader([PackageLoader(room, ".") for room in ("rsibr.studies", "rsibr.validation.report")])
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    environment.filters |= {"number": number, "duration": duration, "size": size, "estimate": estimate, "slope": slope}
    environment.filters |= {"gains": gains, "place": place}
    template = environment.get_template("study.html.j2")
    return template.render(
        document=document,
        baseline=baseline_method(),
        headline=drawn.headline,
        answer=answer(document.doubling, document.judge.frames),
        shown=drawn.scenes,
        bar=", ".join(bar_colours()),  # used by the style sheet that all pages share
        version=__version__,
    )


def estimate(value: EstimateModel) -> str:
    """Format a relMSE with half its interval; below the noise floor, as an upper bound."""
    low, high = value.ci95
    if value.below_noise_floor:
        return f"<\u00a0{number(max(high, 0.0), 2)}"
    return f"{number(value.value)}\u00a0±\u00a0{number((high - low) / 2, 2)}"


def gains(record: GainRecord | None) -> str:
    """Format gains over some pairs: geometric mean · least; ≥ where errors below the noise floor count as that."""
    if record is None:
        return "–"
    return f"{'≥ ' if record.untold else ''}{number(record.mean, 2)} · {number(record.least, 2)}"


def place(pair: PairRecord) -> str:
    """Say where on the disk a method errs: the zone of most of its error, and the worst texel (s, t)."""
    return f"{pair.zone} · ({pair.place.s:.2f}, {pair.place.t:.2f})"


def slope(record: SlopeRecord | None) -> str:
    """Format a slope with its 95 % interval; or that its points do not tell it."""
    if record is None:
        return "–"
    if not record.is_measured:
        return f"not measurable from {record.points} points"
    low, high = record.ci95
    return f"{record.slope:.2f} ({low:.2f} to {high:.2f})".replace("-", "\u2212")


def answer(records: Sequence[DoublingRecord], frames: int) -> list[str]:
    """Describe the gain of twice the time in one sentence for each method.

    Parameters
    ----------
    records : sequence of DoublingRecord
    frames : int
        Pictures of the job.
    """
    return [_sentence(record, frames) for record in records]


def _sentence(record: DoublingRecord, frames: int) -> str:
    start, end = duration(record.seconds[0]), duration(record.seconds[-1])
    reach = f"from {readable(record.rel_mse[0])} in {start} to {readable(record.rel_mse[-1])} in {end}"
    known = [(gain, ci) for gain, ci in zip(record.gain, record.gain_ci95, strict=True) if gain is not None and ci]
    if not known:
        count = f"{record.points} point{'' if record.points == 1 else 's'}"
        return (
            f"{record.method}: {reach} for {frames} pictures; what twice the time buys is not measurable from {count}."
        )
    first, last = _gain(*known[0]), _gain(*known[-1])
    buys = f"divides the error by {first}" + ("" if first == last else f" at first and by {last} at the end")
    return f"{record.method}: {reach} for {frames} pictures; twice the time {buys}."


def _gain(gain: float, ci95: tuple[float, float]) -> str:
    return f"{readable(gain, 2)} ({readable(ci95[0], 2)} to {readable(ci95[1], 2)})"


def _shown(scene: SceneRecord, analysis: SceneAnalysis) -> _Shown:
    by_label = {point.label: point for point in scene.points}
    labels = list(dict.fromkeys([*analysis.job_front, *analysis.fronts["once_seconds"].on]))
    points = sorted((by_label[label] for label in labels), key=lambda point: -point.rel_mse)[-_MOST_SHOWN:]
    return _Shown(
        scene,
        analysis,
        figures.svg_uri(figures.convergence(scene, analysis)),
        figures.svg_uri(figures.fronts(scene, analysis)),
        figures.svg_uri(figures.whereabouts(points)),
    )
