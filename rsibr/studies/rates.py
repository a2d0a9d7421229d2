"""Rates of a forecast: time of each kind of work on this machine, and what follows from them."""

from __future__ import annotations

from pydantic import Field

from rsibr.geometry.viewpoints import icosphere
from rsibr.methods.registry import judged_by_lobe
from rsibr.scene.views import load_viewpoints
from rsibr.studies.agenda import BakeSize
from rsibr.studies.config import JudgeConfig
from rsibr.studies.results import Positive, Record
from rsibr.studies.scene import StudyScene
from rsibr.validation.eval_error import POINTS
from rsibr.validation.eval_error import TIMED_RUNS as EVAL_RUNS


class PathTracingRates(Record):
    """Time of a path-traced picture: launches × launch_seconds + samples × sample_seconds, all compiled."""

    launch_seconds: Positive
    sample_seconds: Positive = Field(description="one sample of one texel")
    compile_seconds: Positive = Field(description="for each new number of samples of a launch")
    scene_seconds: Positive = Field(description="once a scene: building it")


class BakeRates(Record):
    """Time of a bake: setup_seconds + views × (view_seconds + store_seconds + samples × sample_seconds)."""

    setup_seconds: Positive = Field(description="planning, opening, checking: a bake in a scene that is prepared")
    view_seconds: Positive
    store_seconds: Positive = Field(description="a map is checked, compressed and written")
    sample_seconds: Positive = Field(description="one sample of one covered texel")
    scene_seconds: Positive = Field(description="once a scene: probes, lobe fits, light tables, compilation")


class MethodRates(Record):
    """Time of one point of a method."""

    point_seconds: Positive = Field(description="the point of the probe, all compiled")
    compile_seconds: Positive = Field(description="beyond that where the kernels are new")
    frame_seconds: Positive = Field(description="a picture")
    lookup_seconds: Positive = Field(description="one evaluation of eval")
    preparations: int = Field(description="times that the method is made ready, see `preparations`")


class Rates(Record):
    """All figures that a forecast needs, with the sizes that they were measured at."""

    views: int = Field(description="stored views of the probe")
    resolution: int = Field(description="texels a side of its maps")
    judged: int = Field(description="judged views of the probe")
    repeats: int = Field(description="timed runs of each picture of the probe")
    path_tracing: PathTracingRates
    bake: BakeRates
    methods: dict[str, MethodRates]
    decode_seconds: Positive = Field(description="one map is read and decoded")
    compare_seconds: Positive = Field(description="a picture is compared with its reference")
    reread_seconds: Positive = Field(description="a reference is read again for the page")
    figure_seconds: Positive = Field(description="one figure of the page; 0 where it has none")

    def frame_work(self, method: str, texels: float, repeats: int) -> float:
        """Time that one more judged view adds to a point [s]; `texels` are those that are judged."""
        rates = self.methods[method]
        pictures = 1 + repeats + rates.preparations
        lookups = (EVAL_RUNS + 1) * POINTS * texels
        return self.compare_seconds + pictures * rates.frame_seconds + lookups * rates.lookup_seconds

    def view_work(self, method: str) -> float:
        """Time that one more stored view adds to a point [s]: decoded twice, looked at in each preparation."""
        rates = self.methods[method]
        return 2 * self.decode_seconds + rates.preparations * rates.frame_seconds


def view_count(scene: StudyScene, size: BakeSize) -> int:
    """Number of stored views of a bake."""
    return len(icosphere(size.subdivision) if size.subdivision is not None else load_viewpoints(scene.config.views))


def preparations(scene: StudyScene, method: str, judge: JudgeConfig) -> int:
    """Times that a point of a method makes it ready: with the maps, with noisy maps, and for each lobe by itself."""
    if judge.errors_only:
        return 1
    lobes = scene.lobe_names if judged_by_lobe(method) and scene.prepared.keeps_apart else []
    return 2 + (len(lobes) if len(lobes) > 1 else 0)
