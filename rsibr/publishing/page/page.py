"""The page of `rsibr view`: one HTML file with its data, its engine and its style, that asks for nothing else."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup
from matplotlib import colormaps
from matplotlib.colors import to_hex

from rsibr.errors import InputError
from rsibr.publishing.bundle import Bundle, bundle_of, engine_script
from rsibr.publishing.bundle.bundle import FORMAT
from rsibr.publishing.bundle.encoding import Precision
from rsibr.publishing.page.references import error_scale, page_references
from rsibr.publishing.page.still import exposure, nearest_map, picture_uri
from rsibr.publishing.page.subject import Source, Subject, object_of, sphere_of
from rsibr.store.atomic import write_atomic
from rsibr.store.bake import Bake, open_bake
from rsibr.validation.report.page import size
from rsibr.validation.report.pictures import bar_colours
from rsibr.version import __version__

_WEB = files("rsibr.publishing") / "web"
_LUMINANCE_COLOURS = "viridis"
_COLOURS = 33

Bakes = Bake | Path | str | Mapping[str, Bake | Path | str]


@dataclass(frozen=True, repr=False)
class Page:
    """A page that shows a bake; in a notebook it is its own picture.

    Attributes
    ----------
    html : str
        The whole page. It works from the disk and without a network, in any browser with WebGL2.
    title : str
        Title.
    notes : tuple of str
        What of an object is not shown as it is.
    height : int
        Height in a notebook [CSS pixels].
    """

    html: str
    title: str
    notes: tuple[str, ...] = ()
    height: int = 560

    def __repr__(self) -> str:
        return f"Page({self.title!r}, {size(self.bytes)})"

    @property
    def bytes(self) -> int:
        """Size of the file [bytes]."""
        return len(self.html.encode())

    def write(self, path: Path | str) -> Path:
        """Write the page, atomically.

        Raises
        ------
        BakeError, MachineError
            If it cannot be written.
        """
        write_atomic(Path(path), self.html.encode())
        return Path(path)

    def _repr_html_(self) -> str:
        """Return the page in a frame, which saved notebooks keep."""
        text, title = html.escape(self.html), html.escape(self.title)
        style = f"width: 100%; height: {self.height}px; border: 1px solid #8884; border-radius: 4px"
        return f'<iframe srcdoc="{text}" title="{title}" style="{style}" loading="lazy"></iframe>'


def view(
    bakes: Bakes,
    *,
    mesh: Source | None = None,
    reference: Path | str | None = None,
    methods: Sequence[str] | None = None,
    precision: Precision = "half",
    height: int = 560,
    allow_large: bool = False,
) -> Page:
    """Make an interactive page of a bake: a sphere or an object under any view, in the browser or a notebook.

    Parameters
    ----------
    bakes : Bake, path, or mapping of str to either
        One bake; or of an object the bake of each shape id, `"*"` for all other shapes.
    mesh : path, str or dict, optional
        Object: Mitsuba scene, mesh file, or "sphere", as `rsibr.render` takes it. By default a sphere in the parallel
        projection, as a sphere map shows it.
    reference : path, optional
        Directory of a validation of the bake (`rsibr.validate(…, out=…)`), whose references the page shows and measures
        errors against.
    methods : sequence of str, optional
        Methods to offer; by default those that read the stored maps. Fewer make a smaller page.
    precision : {"half", "float"}
        Numbers of the maps: 16 bits, or 32.
    height : int
        Height in a notebook [CSS pixels].
    allow_large : bool
        Take a mesh of more than a million triangles.

    Returns
    -------
    Page
        Shows itself in a notebook; `write(path)` writes it.

    Raises
    ------
    InputError
        If there are several bakes and no object, an object or a method is wrong, or `reference` is no validation of the
        bake.
    BakeError
        If a bake cannot be read.

    Examples
    --------
    >>> rsibr.view("out/paint.rsibr").write("paint.html")               # doctest: +SKIP
    """
    named = _opened(bakes)
    if mesh is None:
        if len(named) > 1 or "*" not in named:
            raise InputError("several bakes, or one of a shape, and no object", where="mesh", fix="name the object")
        subject = sphere_of(named["*"])
    else:
        if reference is not None:
            fix = "leave it out, or show the sphere"
            raise InputError("a validation of maps judges no object", where="reference", fix=fix)
        subject = object_of(mesh, named, allow_large=allow_large)
    bundles = [bundle_of(bake, precision=precision, methods=methods) for bake in subject.bakes]
    return _page(subject, bundles, None if reference is None else Path(reference), height)


def write_page(bakes: Bakes, out: Path | str, **options: Any) -> Path:
    """Write the page that `view` makes, with the same options, to a file."""
    return view(bakes, **options).write(out)


def _opened(bakes: Bakes) -> dict[str, Bake]:
    given = bakes if isinstance(bakes, Mapping) else {"*": bakes}
    if not given:
        raise InputError("no bake", where="bakes", fix="give one")
    return {name: bake if isinstance(bake, Bake) else open_bake(Path(bake)) for name, bake in given.items()}


def _page(subject: Subject, bundles: list[Bundle], reference: Path | None, height: int) -> Page:
    first, factor = subject.bakes[0], exposure(subject.bakes)
    references = page_references(first, reference)
    shared = set.intersection(*(set(bundle.meta["sizes"]) for bundle in bundles))
    methods = [name for name in bundles[0].meta["methods"] if all(name in one.meta["methods"] for one in bundles)]
    if not methods or not shared:
        what = "no method, or no size of maps, that all bakes serve"
        raise InputError(what, where=subject.name, fix="bake all with the same [map] and [effects] settings")
    title = f"{Path(subject.name).stem or first.manifest.material.name} under {first.manifest.environment.name}"
    told = {
        "bakes": [bundle.meta["name"] for bundle in bundles],
        "object": subject.object,
        "camera": subject.camera,
        "exposure": factor,
        "sizes": sorted(shared),
        "size": min((one for one in shared if one >= 256), default=max(shared)),
        "method": bundles[0].meta["default"] if bundles[0].meta["default"] in methods else methods[-1],
        "references": references.meta,
        "error": error_scale(),
        "colours": {"luminance": _hex_colours(_LUMINANCE_COLOURS), "error": bar_colours(_COLOURS)},
    }
    data = [bundle.to_script(f"rsibr-bundle-{k}" if k > 1 else "rsibr-bundle") for k, bundle in enumerate(bundles, 1)]
    arrays = {**subject.arrays, **references.arrays}
    if arrays:
        data.append(Bundle({"format": FORMAT, "name": "page", "methods": []}, arrays).to_script("rsibr-arrays"))
    text = _template().render(
        title=title,
        subject=title,
        facts=_facts(subject),
        notes=subject.notes,
        still=picture_uri(nearest_map(first, [0.48, 0.26, 0.84]), factor),
        still_text=f"Still picture of {first.manifest.material.name} on a sphere",
        style=Markup(_text("page", "style.css")),
        description=Markup(json.dumps(told, separators=(",", ":")).replace("<", "\\u003c")),
        data=Markup("\n".join(data)),
        scripts=[Markup(engine_script()), *(Markup(one) for one in _scripts())],
        version=__version__,
    )
    return Page(text, title, tuple(subject.notes), height)


def _facts(subject: Subject) -> str:
    told = []
    for bake in subject.bakes:
        views = f"{bake.view_count} views of {bake.resolution}²" if bake.has_views else "no stored views"
        told.append(f"{bake.manifest.material.name}: {views}, baked in {bake.seconds:.0f}\u00a0s")
    if subject.object is not None:
        told.append(f"{subject.object['triangles']} triangles")
    return "; ".join(told)


def _hex_colours(name: str) -> list[str]:
    return [to_hex(colormaps[name](k / (_COLOURS - 1))) for k in range(_COLOURS)]


def _template() -> jinja2.Template:
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    return environment.from_string(_text("page.html.j2"))


def _scripts() -> list[str]:
    """Scripts of the page; `start.js`, which runs them, goes last."""
    names = sorted(one.name for one in (_WEB / "page").iterdir() if one.name.endswith(".js"))
    return [_text("page", name) for name in [*(one for one in names if one != "start.js"), "start.js"]]


def _text(*parts: str) -> str:
    return _WEB.joinpath(*parts).read_text(encoding="utf-8")
