"""A scene with the references of its judged views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rsibr.studies.config import JudgeConfig
from rsibr.studies.lobes import lobe_truth
from rsibr.studies.results import ReferenceRecord
from rsibr.studies.scene import StudyScene
from rsibr.studies.truth import Arrays, TruthStore, reference_of
from rsibr.validation.flip import Exposures, exposures_for
from rsibr.validation.metrics import noise_floor, zone_shares
from rsibr.validation.reference import Reference


@dataclass(eq=False)
class JudgedScene:
    """A scene with the references that its pictures are compared with.

    Attributes
    ----------
    scene : StudyScene
    frames : sequence of ndarray, shape (3, 3)
        Judged views.
    judge : JudgeConfig
    store : TruthStore
        References on the disk.
    """

    scene: StudyScene
    frames: Sequence[NDArray[np.float64]]
    judge: JudgeConfig
    store: TruthStore

    @cached_property
    def references(self) -> list[Reference]:
        """Reference of each judged view."""
        return [self.reference(frame) for frame in self.frames]

    def reference(self, frame: NDArray[np.float64]) -> Reference:
        """Reference of one view."""
        return reference_of(self.scene, frame, self.judge.samples, self.store)

    def lobe_truth(self, frame: NDArray[np.float64]) -> Arrays:
        """Reference of each lobe in one view."""
        return lobe_truth(self.scene, frame, self.judge.samples, self.store)

    @cached_property
    def exposures(self) -> Exposures:
        """Exposures of FLIP, from the mean radiance of all references."""
        covered = [reference.mean[reference.coverage > 0] for reference in self.references]
        return exposures_for(float(np.concatenate(covered).mean()))

    def record(self) -> ReferenceRecord:
        """Summary of the references; one is in memory at a time."""
        seconds, floors, zones = [], [], []
        for frame in self.frames:
            reference = self.reference(frame)
            seconds.append(reference.seconds)
            floors.append(noise_floor(reference))
            zones.append(zone_shares(reference))
        return ReferenceRecord(
            samples=reference.samples,
            buffers=len(reference.buffers),
            sampler=reference.sampler,
            seconds=sum(seconds),
            noise_floor=float(np.mean(floors)),
            zones={name: float(np.mean([shares[name] for shares in zones])) for name in zones[0]},
        )

    def forget(self) -> None:
        """Release the references in memory; files stay."""
        self.__dict__.pop("references", None)
