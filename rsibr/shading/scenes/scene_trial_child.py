"""Child process of `rsibr.scene.trial`: loads a user's scene, which may crash it, and traces some rays.

`python -m rsibr.shading.scenes.scene_trial_child` reads from stdin, as JSON, the path of an XML file or its text.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi

from rsibr import backend
from rsibr.scene.python_plugins import load_plugins
from rsibr.scene.trial_child import main
from rsibr.shading.scenes.mitsuba_scene import SceneSource, instantiated
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surfaces import first_surfaces

_RAYS = 64


def try_scene(document: dict[str, Any]) -> None:
    """Load the scene in `document` and trace rays to it; raises what the loader raises."""
    backend.use()
    load_plugins(document.get("modules", ()))
    _exercise(Path(document["file"]) if "file" in document else document["text"])


def _exercise(source: SceneSource) -> None:
    shapes, _, _ = instantiated(source, "trial")
    scene = ObjectScene("trial", shapes)
    u = dr.linspace(mi.Float, 0.01, 0.99, _RAYS)
    away = mi.warp.square_to_uniform_sphere(mi.Point2f(u, 0.5))
    ray = mi.Ray3f(mi.Point3f(scene.centre.tolist()) + 2 * scene.radius * away, -away)
    dr.eval(first_surfaces(scene.geometry, ray))
    dr.sync_thread()


if __name__ == "__main__":
    sys.exit(main(try_scene))
