"""Maps of the shown view of each scene: reference, each system, and their errors, on one exposure and one scale."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from rsibr.methods.method_name import file_stem
from rsibr.studies.compare.measure import SHOWN, Measured
from rsibr.studies.compare.records import ComparedScene
from rsibr.validation.metrics import relative_noise_map
from rsibr.validation.reference import Reference
from rsibr.validation.report import pictures
from rsibr.validation.report.pictures import RELATIVE_ERROR, Rgba


@dataclass(frozen=True, eq=False)
class SystemPictures:
    """Best setting of one system on a scene.

    Attributes
    ----------
    label : str
    image, error : ndarray, shape (N, N, 4), uint8
        Tone-mapped map, and relative error in false colour.
    """

    label: str
    image: Rgba
    error: Rgba


@dataclass(frozen=True, eq=False)
class ScenePictures:
    """Pictures of one scene at its shown view.

    Attributes
    ----------
    folder : str
        Prefix of the file names.
    reference, noise : ndarray, shape (N, N, 4), uint8
        Tone-mapped reference, and its own relative noise on the scale of the errors.
    systems : dict of str to SystemPictures
    """

    folder: str
    reference: Rgba
    noise: Rgba
    systems: dict[str, SystemPictures]

    def named(self) -> Iterator[tuple[str, Rgba]]:
        """Yield file names and pictures."""
        yield f"{self.folder}_reference.png", self.reference
        yield f"{self.folder}_noise.png", self.noise
        for name, drawn in self.systems.items():
            yield f"{self.folder}_map_{file_stem(name)}.png", drawn.image
            yield f"{self.folder}_error_{file_stem(name)}.png", drawn.error


def draw_scene(
    scene: ComparedScene, references: Sequence[Reference], measured: Mapping[str, Measured]
) -> ScenePictures:
    """Draw the setting with the least error of each system, with one exposure for the scene.

    Parameters
    ----------
    scene : ComparedScene
    references : sequence of Reference
        Of all judged views; they determine the exposure.
    measured : mapping of str to Measured
        Measurements by label.
    """
    exposure, shown = pictures.display_exposure(references), references[SHOWN]
    systems = {}
    for name, record in scene.best().items():
        one = measured[record.label]
        if one.image is not None and one.relative_error is not None:
            image = pictures.tone_mapped(one.image, shown.coverage, exposure)
            systems[name] = SystemPictures(
                record.label, image, pictures.false_colour(one.relative_error, RELATIVE_ERROR)
            )
    return ScenePictures(
        scene.folder,
        pictures.tone_mapped(shown.mean, shown.coverage, exposure),
        pictures.false_colour(relative_noise_map(shown), RELATIVE_ERROR),
        systems,
    )
