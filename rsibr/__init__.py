"""rsibr: reflection-space image based rendering on Mitsuba 3, with measured error.

Bake a material under a distant environment into a few radiance sphere maps, reconstruct the map of any other view from
them, and compare it with a path-traced reference:

>>> import rsibr
>>> bake = rsibr.bake(rsibr.configs() / "demo.toml", out="out/paint.rsibr")     # doctest: +SKIP
>>> paint = rsibr.reconstruct(bake, view=(1, 2, 3))                             # doctest: +SKIP
>>> report = rsibr.validate(bake, views=8, out="out/report")                    # doctest: +SKIP

Modules that are public as a whole: `rsibr.metrics` (errors of a map against a reference), `rsibr.pictures` (maps and
errors as images), `rsibr.plots` (figures of a study).
"""

from __future__ import annotations

import importlib
from threading import RLock
from typing import TYPE_CHECKING, Any

from rsibr.version import __version__

if TYPE_CHECKING:
    from rsibr.batches.batch import batch as batch
    from rsibr.budget.bake import bake as bake
    from rsibr.budget.bake import plan as plan
    from rsibr.capture.added_lamps import capture_light as capture_light
    from rsibr.capture.ball import BallShot as BallShot
    from rsibr.capture.ball import capture_ball as capture_ball
    from rsibr.capture.hdr import capture_hdr as capture_hdr
    from rsibr.capture.lamps.lamp import Lamp as Lamp
    from rsibr.capture.lamps.lamp import point_lamp as point_lamp
    from rsibr.capture.maps.imported import import_maps as import_maps
    from rsibr.capture.maps.photographed import capture_maps as capture_maps
    from rsibr.capture.painted import capture_painted as capture_painted
    from rsibr.capture.six_images import capture_six as capture_six
    from rsibr.capture.sun import capture_sun as capture_sun
    from rsibr.capture.synth import capture_synth as capture_synth
    from rsibr.lobes.albedo import node_cosines as node_cosines
    from rsibr.methods.method_set import MethodSet as MethodSet
    from rsibr.methods.protocol import Method as Method
    from rsibr.methods.protocol import PointwiseMethod as PointwiseMethod
    from rsibr.methods.reconstruction import reconstruct as reconstruct
    from rsibr.methods.registry import method_names as method_names
    from rsibr.methods.registry import register as register
    from rsibr.publishing.notebooks.side_by_side import side_by_side as side_by_side
    from rsibr.publishing.page.page import view as view
    from rsibr.publishing.publish import publish as publish
    from rsibr.resources import configs as configs
    from rsibr.resources import scenes as scenes
    from rsibr.scene.config import load_config as load_config
    from rsibr.shading.cameras.fitted_camera import fitted_camera as fitted_camera
    from rsibr.shading.integrator import register_plugins as register_plugins
    from rsibr.shading.pictures.sequence import render_sequence as render_sequence
    from rsibr.shading.render import render as render
    from rsibr.shading.renderer import ObjectRenderer as ObjectRenderer
    from rsibr.shading.scenes.scene_file import open_scene as open_scene
    from rsibr.shown_progress import show_progress as show_progress
    from rsibr.store.bake import open_bake as open_bake
    from rsibr.store.pack import pack as pack
    from rsibr.studies import figures as plots
    from rsibr.studies.compare.runner import compare as compare
    from rsibr.studies.runner import study as study
    from rsibr.validation import metrics as metrics
    from rsibr.validation.health.check import check as check
    from rsibr.validation.objects.truths import object_truths as object_truths
    from rsibr.validation.objects.validation import validate_object as validate_object
    from rsibr.validation.report import pictures as pictures
    from rsibr.validation.validation import timed as timed
    from rsibr.validation.validation import validate as validate

_HOME = {
    "BallShot": "rsibr.capture.ball",
    "Lamp": "rsibr.capture.lamps.lamp",
    "Method": "rsibr.methods.protocol",
    "MethodSet": "rsibr.methods.method_set",
    "ObjectRenderer": "rsibr.shading.renderer",
    "PointwiseMethod": "rsibr.methods.protocol",
    "bake": "rsibr.budget.bake",
    "batch": "rsibr.batches.batch",
    "capture_ball": "rsibr.capture.ball",
    "capture_hdr": "rsibr.capture.hdr",
    "capture_light": "rsibr.capture.added_lamps",
    "capture_maps": "rsibr.capture.maps.photographed",
    "capture_painted": "rsibr.capture.painted",
    "capture_six": "rsibr.capture.six_images",
    "capture_sun": "rsibr.capture.sun",
    "capture_synth": "rsibr.capture.synth",
    "check": "rsibr.validation.health.check",
    "compare": "rsibr.studies.compare.runner",
    "configs": "rsibr.resources",
    "fitted_camera": "rsibr.shading.cameras.fitted_camera",
    "import_maps": "rsibr.capture.maps.imported",
    "load_config": "rsibr.scene.config",
    "method_names": "rsibr.methods.registry",
    "node_cosines": "rsibr.lobes.albedo",
    "object_truths": "rsibr.validation.objects.truths",
    "open_bake": "rsibr.store.bake",
    "open_scene": "rsibr.shading.scenes.scene_file",
    "pack": "rsibr.store.pack",
    "plan": "rsibr.budget.bake",
    "point_lamp": "rsibr.capture.lamps.lamp",
    "publish": "rsibr.publishing.publish",
    "reconstruct": "rsibr.methods.reconstruction",
    "register": "rsibr.methods.registry",
    "register_plugins": "rsibr.shading.integrator",
    "render": "rsibr.shading.render",
    "render_sequence": "rsibr.shading.pictures.sequence",
    "scenes": "rsibr.resources",
    "show_progress": "rsibr.shown_progress",
    "side_by_side": "rsibr.publishing.notebooks.side_by_side",
    "study": "rsibr.studies.runner",
    "timed": "rsibr.validation.validation",
    "validate": "rsibr.validation.validation",
    "validate_object": "rsibr.validation.objects.validation",
    "view": "rsibr.publishing.page.page",
}
"""Module that holds each public function and class."""

_importing = RLock()
"""One thread at a time imports: Mitsuba and Dr.Jit crash when several threads import them at once."""

_MODULES = {
    "metrics": "rsibr.validation.metrics",
    "pictures": "rsibr.validation.report.pictures",
    "plots": "rsibr.studies.figures",
}
"""Modules that are public as a whole, by their public name."""

__all__ = [
    "BallShot",
    "Lamp",
    "Method",
    "MethodSet",
    "ObjectRenderer",
    "PointwiseMethod",
    "__version__",
    "bake",
    "batch",
    "capture_ball",
    "capture_hdr",
    "capture_light",
    "capture_maps",
    "capture_painted",
    "capture_six",
    "capture_sun",
    "capture_synth",
    "check",
    "compare",
    "configs",
    "fitted_camera",
    "import_maps",
    "load_config",
    "method_names",
    "metrics",
    "node_cosines",
    "object_truths",
    "open_bake",
    "open_scene",
    "pack",
    "pictures",
    "plan",
    "plots",
    "point_lamp",
    "publish",
    "reconstruct",
    "register",
    "register_plugins",
    "render",
    "render_sequence",
    "scenes",
    "show_progress",
    "side_by_side",
    "study",
    "timed",
    "validate",
    "validate_object",
    "view",
]


def __getattr__(name: str) -> Any:
    """Import public names at their first use, so that `import rsibr` loads neither Mitsuba nor matplotlib."""
    with _importing:
        if name in _MODULES:
            value: Any = importlib.import_module(_MODULES[name])
        elif name in _HOME:
            value = getattr(importlib.import_module(_HOME[name]), name)
        else:
            raise AttributeError(f"module 'rsibr' has no attribute '{name}'")
    return globals().setdefault(name, value)


def __dir__() -> list[str]:
    """List the public names, imported or not."""
    return __all__
