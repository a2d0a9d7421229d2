"""Loading of a BSDF from plain data or XML, after checks for input that would crash Mitsuba."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mitsuba as mi
import numpy as np

import rsibr.scene.paint.car_paint  # noqa: F401  # registers its plugin
from rsibr import backend
from rsibr.errors import InputError
from rsibr.scene import blend
from rsibr.scene.plugin import canonical_json, content_digest, mitsuba_errors, named_files, named_types
from rsibr.scene.python_plugins import sources_of
from rsibr.scene.spectrum_file import read_spectrum
from rsibr.scene.xml_files import XmlFiles

BsdfSource = dict[str, Any] | Path
"""Mitsuba BSDF as plain data, or path of its XML file."""

NESTED: Mapping[str, tuple[int, int]] = {"blendbsdf": (2, 2), "twosided": (1, 2), "mask": (1, 1)}
"""Least and largest number of nested BSDFs of a wrapper. A `blendbsdf` without any crashes Mitsuba."""

_PLASTICS = ("plastic", "roughplastic", "pplastic")
_PLASTIC_COLOURS = ("diffuse_reflectance", "specular_reflectance")
_TEXTURES = ("bitmap", "checkerboard", "mesh_attribute", "volume")
_FIX = "see the BSDFs in Mitsuba's plugin reference"


def load_bsdf(source: BsdfSource, where: str) -> mi.BSDF:
    """Load a BSDF in the current variant.

    Parameters
    ----------
    source : dict or Path
        Plain data, or an XML file whose root is a BSDF or a scene with exactly one top-level BSDF.
    where : str
        File or config key that an error names.

    Raises
    ------
    InputError
        If it is not well-formed, names an unknown plugin or parameter, is not a BSDF, lacks nested BSDFs, or is
        textured: a sphere map holds one material.
    """
    # Names in XML may be undecodable bytes: reading any name can raise
    with _checked_files(source, where), backend.loading(), mitsuba_errors(where, _FIX):
        state = _parse(source, where)
        _require_constant(state, where)
        require_nested(state, where)
        _root_at_bsdf(state, where)
        replace_plugins(state)
        return mi.parser.instantiate(parser_config(), state)


def bsdf_data(xml: Path, where: str) -> dict[str, Any]:
    """Plain data of the BSDF in an XML file, with the values that Mitsuba's parser reads: spectra are tables.

    Raises
    ------
    InputError
        As `load_bsdf`, which also loads it.
    """
    with _checked_files(xml, where), mitsuba_errors(where, _FIX):
        state = _parse(xml, where)
        _root_at_bsdf(state, where)
        return _node_data(state, state.root)


def _node_data(state: mi.parser.ParserState, node: mi.parser.SceneNode) -> dict[str, Any]:
    props, types = node.props, mi.Properties.Type
    data: dict[str, Any] = {"type": props.plugin_name()}
    for key in list(props.keys()):
        kind = props.type(key)
        if kind == types.ResolvedReference:
            data[key] = _node_data(state, state.nodes[props[key].index()])
        elif kind == types.Spectrum and (table := props[key]).wavelengths:
            data[key] = {"type": "spectrum", "value": list(zip(table.wavelengths, table.values, strict=True))}
        elif kind in (types.String, types.Float, types.Integer, types.Bool):
            data[key] = props[key]
    return data


def bsdf_digest(source: BsdfSource, where: str) -> str:
    """SHA-256 of a BSDF's content and of the files that it names, independent of its own file name.

    Comments and white space in XML are ignored. The source of a Python plugin is included if its module was named.
    """
    if isinstance(source, dict):
        return content_digest(canonical_json(source), [*named_files(source), *sources_of(named_types(source))])
    files = XmlFiles.of(source, where)
    texts = [ElementTree.canonicalize(from_file=str(file), strip_text=True) for file, _ in files.documents]
    included = [file for file, _ in files.documents[1:]]
    return content_digest("\n".join(texts), [*included, *files.spectra, *files.data, *sources_of(files.types)])


def parser_config() -> mi.parser.ParserConfig:
    """Configuration of Mitsuba's parser in the current variant: nodes as written, one after another."""
    config = mi.parser.ParserConfig(mi.variant())
    config.merge_meshes = config.merge_equivalent = False  # keep the nodes as written
    config.parallel = False  # two Python plugins that are instantiated at once end the process
    return config


def _parse(source: BsdfSource, where: str) -> mi.parser.ParserState:
    config = parser_config()
    with mitsuba_errors(where, _FIX):
        parse = mi.parser.parse_file if isinstance(source, Path) else mi.parser.parse_dict
        state = parse(config, str(source) if isinstance(source, Path) else source)
        mi.parser.transform_all(config, state)
        return state


def _require_constant(state: mi.parser.ParserState, where: str) -> None:
    for node in state.nodes:
        name = node.props.plugin_name()
        if node.type == mi.ObjectType.Texture and name in _TEXTURES:
            raise InputError(
                f"the texture '{name}' varies over the surface, and a sphere map holds one material",
                where=where,
                fix="use a constant value",
            )


def require_nested(state: mi.parser.ParserState, where: str) -> None:
    """Raise an InputError unless each wrapper has its nested BSDFs, without which Mitsuba may crash."""
    for node in state.nodes:
        name = node.props.plugin_name()
        fewest, most = NESTED.get(name, (0, len(state.nodes)))
        types = [child.type for child in _children(state, node)]
        nested = types.count(mi.ObjectType.BSDF)
        unknown = types.count(
            mi.ObjectType.Unknown
        )  # Python plugins, whose type is known only when they are instantiated
        if node.type == mi.ObjectType.BSDF and not (fewest <= nested + unknown and nested <= most):
            wanted = str(fewest) if fewest == most else f"{fewest} or {most}"
            raise InputError(f"'{name}' has {nested} nested BSDFs, and takes {wanted}", where=where, fix=_FIX)


def _root_at_bsdf(state: mi.parser.ParserState, where: str) -> None:
    """Make the scene's only BSDF the root, so that nothing else is loaded."""
    if state.root.type != mi.ObjectType.Scene:
        _require_bsdf(state.root, where)
        return
    bsdfs = [node for node in state.nodes if node.type == mi.ObjectType.BSDF]
    nested = {id_ for node in bsdfs for id_ in _references(node)}
    top = [i for i, node in enumerate(state.nodes) if node.type == mi.ObjectType.BSDF and i not in nested]
    if len(top) != 1:
        raise InputError(f"the scene holds {len(top)} BSDFs, not one", where=where, fix="leave exactly one in it")
    state.nodes[0] = state.nodes[top[0]]


def replace_plugins(state: mi.parser.ParserState) -> None:
    """Put plugins that are right in place of those of Mitsuba that are not."""
    for node in state.nodes:
        name = node.props.plugin_name()
        if name == "blendbsdf":
            node.props.set_plugin_name(blend.PLUGIN)
        elif name in _PLASTICS and all(_is_black(node.props, key) for key in _PLASTIC_COLOURS):
            # Mitsuba chooses a component by 0/0. Other parameters are dropped with the plugin that reads them
            for key in list(node.props.keys()):
                del node.props[key]
            node.props.set_plugin_name("diffuse")
            node.props["reflectance"] = mi.ScalarColor3d(0)


def _is_black(props: mi.Properties, key: str) -> bool:
    """Whether a colour is written as zero; a colour that a texture gives is not looked at."""
    if key not in props:
        return False
    kind, types = props.type(key), mi.Properties.Type
    if kind == types.Spectrum:
        return not any(props[key].values)
    return kind in (types.Float, types.Integer, types.Color) and not np.array(props[key]).any()


def _require_bsdf(node: mi.parser.SceneNode, where: str) -> None:
    # A dictionary node of an unknown plugin has no type; instantiation raises the error
    if node.type not in (mi.ObjectType.BSDF, mi.ObjectType.Unknown):
        kind = str(node.type).rpartition(".")[2].lower()
        raise InputError(f"'{node.props.plugin_name()}' is not a BSDF ({kind})", where=where, fix=_FIX)


def _references(node: mi.parser.SceneNode) -> list[int]:
    # Read references only: Mitsuba treats every property that has been read as known to the plugin
    props, reference = node.props, mi.Properties.Type.ResolvedReference
    return [props[key].index() for key in props.keys() if props.type(key) == reference]  # noqa: SIM118


def _children(state: mi.parser.ParserState, node: mi.parser.SceneNode) -> list[mi.parser.SceneNode]:
    return [state.nodes[i] for i in _references(node)]


@contextmanager
def _checked_files(source: BsdfSource, where: str) -> Iterator[None]:
    """Check the files that a BSDF names before Mitsuba reads them; those in XML are found as `XmlFiles` says."""
    if isinstance(source, dict):
        _check_spectra(source, where)
        yield
        return
    before = mi.file_resolver()
    mi.set_file_resolver(XmlFiles.of(source, where).resolver())
    try:
        yield
    finally:
        mi.set_file_resolver(before)


def _check_spectra(plugin: Mapping[str, Any], where: str) -> None:
    if plugin.get("type") == "spectrum" and "filename" in plugin:
        read_spectrum(Path(plugin["filename"]), where)
    for value in plugin.values():
        if isinstance(value, Mapping):
            _check_spectra(value, where)
