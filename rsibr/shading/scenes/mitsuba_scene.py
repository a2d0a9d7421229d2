"""Shapes and camera of a Mitsuba scene, given as XML or as a dictionary.

Only shapes, with their BSDFs, and one sensor are instantiated. Emitters, media and integrators of the scene stay in
its file: the light is that of the bakes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr import backend
from rsibr.errors import InputError
from rsibr.resources import scenes
from rsibr.scene.mitsuba_bsdf import parser_config, replace_plugins, require_nested
from rsibr.scene.plugin import mitsuba_errors
from rsibr.scene.trial import require_survival_of, warn_untried
from rsibr.scene.xml_files import XmlFiles
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.scenes.unique_name import unique_name

SceneSource = dict[str, Any] | Path | str
"""Mitsuba scene: a dictionary, path of an XML file, or text of one whose relative names start at the working folder."""

_FIX = "see Mitsuba's plugin reference"
_TRIAL = "rsibr.shading.scenes.scene_trial_child"
_PERSPECTIVE = ("perspective", "thinlens")
_ROUND = ("sphere", "cylinder")
"""Shapes that Mitsuba has in no stretched form."""
_GROUPS = ("shapegroup", "instance")


def load_scene(source: SceneSource, where: str) -> tuple[dict[str, mi.Shape], Camera | None, tuple[str, ...]]:
    """Load the shapes and the camera of a scene in the current variant.

    It is first loaded in a child process, because Mitsuba crashes on some input; a scene shipped with rsibr is not.

    Parameters
    ----------
    source : dict, Path or str
        A scene; a dictionary may be a single shape.
    where : str
        File or name that an error names.

    Returns
    -------
    shapes : dict of str to mi.Shape
        Shapes by id, those without one by their place: `shape-2`. Instances are copies of the shapes of their group,
        `INSTANCE-SHAPE`.
    camera : Camera or None
        From the first perspective sensor.
    notes : tuple of str
        What is not used, in a sentence each.

    Raises
    ------
    InputError
        If it is not well-formed, names a missing file or an unknown plugin, holds no shape, or crashes Mitsuba.
    """
    untried = "" if _is_shipped(source) else _require_survival(source, where)
    shapes, sensor, notes = instantiated(source, where)
    warn_untried(untried)
    if sensor is None:
        return shapes, None, tuple(notes)
    camera = Camera.of_sensor(sensor)
    if sensor.needs_aperture_sample():
        notes.append("the lens of its sensor is taken as a pinhole: everything is in focus")
    return shapes, camera, tuple(notes)


def instantiated(source: SceneSource, where: str) -> tuple[dict[str, mi.Shape], mi.Sensor | None, list[str]]:
    """Shapes by id, first perspective sensor and notes of a scene, loaded in this process without a trial."""
    with _files(source, where), backend.loading(), mitsuba_errors(where, _FIX):
        state = _parse(source)
        notes = _keep_shapes_and_sensor(state, where)
        require_nested(state, where)
        replace_plugins(state)
        scene = mi.parser.instantiate(parser_config(), state)
    shapes = {str(shape.id()): shape for shape in scene.shapes()}
    for name, shape in shapes.items():
        if shape.is_emitter():  # an object that the caller has loaded
            fix = "give it as plain data, or load it without its emitter"
            raise InputError(f"the shape '{name}' was loaded with an emitter", where=where, fix=fix)
        if shape.is_mesh():
            _require_vertices(shape, name, where)
    sensors = scene.sensors()
    return shapes, sensors[0] if sensors else None, notes


def _require_vertices(mesh: mi.Mesh, name: str, where: str) -> None:
    """Refuse faces of vertices that do not exist: Mitsuba reads whatever lies there."""
    values = mi.traverse(mesh)
    faces = values["faces"] if "faces" in values else mi.UInt32()
    if dr.width(faces) and int(dr.max(faces)[0]) >= mesh.vertex_count():
        what = f"'{name}' has faces of vertices that do not exist ({mesh.vertex_count()} are there)"
        raise InputError(what, where=where, fix="export its file anew: it is damaged")


def _is_shipped(source: SceneSource) -> bool:
    return isinstance(source, Path) and source.resolve().is_relative_to(scenes().resolve())


def _require_survival(source: SceneSource, where: str) -> str:
    """Reason why a scene was not tried; empty if it was."""
    if isinstance(source, Path):
        files = XmlFiles.of(source, where, ("bsdf", "shape"))
        named = [*(file for file, _ in files.documents), *files.spectra, *files.data]
        return require_survival_of(_TRIAL, {"file": str(source.resolve())}, files.types, named, where)
    with mitsuba_errors(where, _FIX):
        state = _parse(source)
        types = {node.props.plugin_name() for node in state.nodes} - {""}
        _keep_shapes_and_sensor(state, where)
    try:
        text = mi.parser.write_string(state)
    except RuntimeError:  # it holds loaded objects or arrays, which have lived in this process already
        return ""
    return require_survival_of(_TRIAL, {"text": text}, types, [], where)


def _parse(source: SceneSource) -> mi.parser.ParserState:
    config = parser_config()
    if isinstance(source, Path):
        state = mi.parser.parse_file(config, str(source))
    elif isinstance(source, str):
        state = mi.parser.parse_string(config, source)
    else:
        state = mi.parser.parse_dict(config, source)
    if state.root.type == mi.ObjectType.Shape and isinstance(source, dict):
        name = state.root.props.plugin_name()
        state = mi.parser.parse_dict(config, {"type": "scene", name: source})
    mi.parser.transform_all(config, state)
    return state


@contextmanager
def _files(source: SceneSource, where: str) -> Iterator[None]:
    """Have Mitsuba find the files that an XML file names, as `XmlFiles` found them."""
    if not isinstance(source, Path):
        yield
        return
    before = mi.file_resolver()
    mi.set_file_resolver(XmlFiles.of(source, where, ("bsdf", "shape")).resolver())
    try:
        yield
    finally:
        mi.set_file_resolver(before)


def _keep_shapes_and_sensor(state: mi.parser.ParserState, where: str) -> list[str]:
    """Take everything off a scene but its shapes and its first perspective sensor; name the shapes, copy instances."""
    root, kinds = state.root, mi.ObjectType
    if root.type != kinds.Scene:
        kind = str(root.type).rpartition(".")[2].lower()
        what = f"'{root.props.plugin_name()}' is neither a scene nor a shape ({kind})"
        raise InputError(what, where=where, fix="give a scene with shapes")
    dropped: Counter[str] = Counter()
    others: list[str] = []
    shapes: list[tuple[str, int]] = []
    camera = ""
    for key, index in list(_references(root)):
        node = state.nodes[index]
        name = node.props.plugin_name()
        if node.type == kinds.Shape:
            shapes.append((key, index))
        elif node.type == kinds.Sensor and name in _PERSPECTIVE and not camera:
            camera = key
        elif node.type != kinds.Unknown:
            dropped["emitters"] += node.type == kinds.Emitter
            others += [name] if node.type == kinds.Sensor else []
            del root.props[key]
    _rename_and_copy(state, shapes, dropped, where)
    return _notes(dropped, others, has_camera=bool(camera))


def _rename_and_copy(
    state: mi.parser.ParserState, shapes: list[tuple[str, int]], dropped: Counter[str], where: str
) -> None:
    taken = {state.nodes[index].props.id() for _, index in shapes} - {""}
    copies: list[mi.parser.SceneNode] = []
    for number, (key, index) in enumerate(shapes, 1):
        node = state.nodes[index]
        plugin, name = node.props.plugin_name(), node.props.id()
        if not name:
            name = unique_name(f"shape-{number}", taken)
            taken.add(name)
        if plugin not in _GROUPS:
            node.props.set_id(name)
            _strip(state, node, dropped)
            continue
        del state.root.props[key]
        for copy in _copies(state, node, where) if plugin == "instance" else ():
            copied = unique_name(f"{name}-{copy.props.id() or copy.props.plugin_name()}", taken)
            taken.add(copied)
            copy.props.set_id(copied)
            _strip(state, copy, dropped)
            copies.append(copy)
    # ---- Last, as the list moves when it grows, and references to its nodes would dangle ----
    first = len(state.nodes)
    for copy in copies:
        state.nodes.append(copy)
    for index in range(first, first + len(copies)):
        state.root.props[f"instance {index}"] = mi.Properties.ResolvedReference(index)


def _copies(state: mi.parser.ParserState, instance: mi.parser.SceneNode, where: str) -> Iterator[mi.parser.SceneNode]:
    """Copies of the shapes of an instance's group, with the transforms of both."""
    groups = [state.nodes[i] for _, i in _references(instance) if state.nodes[i].props.plugin_name() == "shapegroup"]
    if len(groups) != 1:
        fix = "have it refer to one shapegroup"
        raise InputError(f"an instance of {len(groups)} shape groups", where=where, fix=fix)
    for _, index in list(_references(groups[0])):
        if state.nodes[index].type == mi.ObjectType.Shape:
            copy = mi.parser.SceneNode(state.nodes[index])
            copy.props = mi.Properties(state.nodes[index].props)
            transforms = [node.props["to_world"] for node in (instance, copy) if "to_world" in node.props]
            if transforms:
                whole = transforms[0] if len(transforms) == 1 else transforms[0] @ transforms[1]
                plugin = copy.props.plugin_name()
                if plugin in _ROUND and not _keeps_shape(whole):
                    fix = "use a mesh, or one scale for all directions"
                    raise InputError(f"an instance stretches or shears a {plugin}", where=where, fix=fix)
                copy.props["to_world"] = whole
            yield copy


def _keeps_shape(transform: mi.ScalarTransform4f) -> bool:
    """Whether it rotates, moves and scales by one factor only."""
    linear = np.array(transform.matrix, dtype=np.float64).reshape(4, 4)[:3, :3]
    metric = linear.T @ linear
    return bool(np.allclose(metric, np.trace(metric) / 3 * np.eye(3), atol=1e-4 * np.trace(metric)))


def _strip(state: mi.parser.ParserState, shape: mi.parser.SceneNode, dropped: Counter[str]) -> None:
    """Take emitters, media and sensors off a shape."""
    kinds = mi.ObjectType
    words = {kinds.Emitter: "glowing shapes", kinds.Medium: "media", kinds.Sensor: ""}
    for key, index in list(_references(shape)):
        kind = state.nodes[index].type
        if kind in words:
            dropped[words[kind]] += 1
            del shape.props[key]


def _references(node: mi.parser.SceneNode) -> Iterator[tuple[str, int]]:
    # Read references only: Mitsuba treats every property that has been read as known to the plugin
    props, reference = node.props, mi.Properties.Type.ResolvedReference
    for key in list(props.keys()):
        if props.type(key) == reference:
            yield key, props[key].index()


def _notes(dropped: Counter[str], others: list[str], *, has_camera: bool) -> list[str]:
    notes = []
    if count := dropped["emitters"]:
        which = "1 emitter of the scene is" if count == 1 else f"{count} emitters of the scene are"
        notes.append(f"{which} not used: the light is that of the bakes")
    if count := dropped["glowing shapes"]:
        which = "1 shape glows in the scene, and does" if count == 1 else f"{count} shapes glow in the scene, and do"
        notes.append(f"{which} not here: the light is that of the bakes")
    if count := dropped["media"]:
        notes.append(f"{count} participating {'medium is' if count == 1 else 'media are'} not used")
    if others and has_camera:
        notes.append(f"{len(others)} further sensor{'s are' if len(others) > 1 else ' is'} not used")
    elif others:
        named = ", ".join(f"'{name}'" for name in dict.fromkeys(others))
        notes.append(f"its sensor is not used: pictures are perspective, and it is {named}")
    return notes
