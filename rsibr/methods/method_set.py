"""Methods of one bake, made at first use, with shared inputs made once."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rsibr import backend
from rsibr.errors import BakeError, InputError
from rsibr.methods.device_size import device_bytes
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.protocol import Cost, Method
from rsibr.methods.registry import Registration, available, registration
from rsibr.store.soundness import fault_of, is_all_black
from rsibr.store.stored_maps import StoredMaps


class MethodSet(Mapping[str, Method]):
    """Methods of one bake by name; they share its maps and its environment on the device.

    Iteration yields the names of the methods whose requirements the bake meets.

    Parameters
    ----------
    bake : StoredMaps
        A finished bake. Nothing is read before a method is made.

    Attributes
    ----------
    inputs : MethodInputs
        Shared inputs of the methods.

    Examples
    --------
    >>> methods = rsibr.MethodSet(rsibr.open_bake("paint.rsibr"))     # doctest: +SKIP
    >>> list(methods)                                                  # doctest: +SKIP
    ['nearest', 'blend', 'cabral1999', 'cabral1999-mesh', 'rsibr', 'rsibr-fine']
    """

    def __init__(self, bake: StoredMaps) -> None:
        self.inputs = MethodInputs(bake)
        self._made: dict[str, Method] = {}

    def __getitem__(self, name: str) -> Method:
        """Make the method `name`, or return it if it exists already.

        Raises
        ------
        InputError
            If no method has this name.
        BakeError
            If the bake lacks something that the method requires.
        """
        with backend.session():  # one thread at a time makes a method
            if name not in self._made:
                self._made[name] = self.variant(name)
            return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(available(self.inputs.bake))

    def __len__(self) -> int:
        return len(available(self.inputs.bake))

    def __contains__(self, name: object) -> bool:
        return name in available(self.inputs.bake)

    def __repr__(self) -> str:
        return f"MethodSet({self.inputs.bake.path.name!r}: {', '.join(self)})"

    def variant(self, name: str, **options: Any) -> Method:
        """Make a method with non-default options, for example for a single lobe; it is not cached.

        Parameters
        ----------
        name : str
            Name of the method; see `rsibr.methods.registry.registration`.
        **options
            Keyword parameters of the method's factory; `Registration.options` lists them. They go before those of the
            name, and these before those of the bake's config (`Config.methods`).

        Raises
        ------
        InputError, BakeError
            As `__getitem__`.
        """
        found = registration(name)
        require_served(found, self.inputs.bake)
        with backend.session(), self.inputs.watched() as shared:
            start = time.perf_counter()
            made: Any = found.make(self.inputs, **{**self._configured(found), **options})
            backend.synchronize()
            if not isinstance(made, Method):
                what = f"makes {type(made).__name__}, which is no method: it has no eval and no map"
                raise InputError(what, where=f"method {name}", fix="name a class such as one of PointwiseMethod")
            own = time.perf_counter() - start - shared.seconds_here
        made.name = ",".join([name, *(f"{option}={value}" for option, value in options.items())])
        on_device = device_bytes([getattr(made, "__dict__", made), *self.inputs.made(shared.used)])
        made.cost = self._cost(shared.used, own + shared.seconds_ever, on_device)
        return made

    def _configured(self, method: Registration) -> dict[str, Any]:
        """Options that the bake's config sets for a method, without those that its name fixes."""
        tables = self.inputs.bake.manifest.config.get("methods") or {}
        table = tables.get(method.alias_of or method.name, {}) if method.options else {}
        method.require_options(table, f"{self.inputs.bake.path}: methods.{method.name}")
        return {option: value for option, value in table.items() if option not in method.fixed}

    def _cost(self, used: set[str], prepare_seconds: float, device_bytes: int) -> Cost:
        """Cost of a method that used these inputs: of the bake, only what is behind them."""
        bake, light = self.inputs.bake, self.inputs.bake.manifest.light
        of_light = 0 if light is None else light.bytes
        reads_maps = "maps" in used
        seconds = bake.seconds - (0.0 if reads_maps else bake.manifest.seconds)
        size = (bake.bytes - of_light if reads_maps else 0) + (of_light if "light" in used else 0)
        return Cost(max(0.0, seconds), size, prepare_seconds, device_bytes, reads_maps)


def require_served(method: Registration, bake: StoredMaps) -> None:
    """Raise a BakeError if the bake is unusable, or lacks something that the method requires."""
    where = str(bake.path)
    if fault := fault_of(bake.manifest, lambda: _should_shine(bake)):
        raise BakeError(fault, where=where, fix="see `rsibr check`, mend the material or the light, and bake anew")
    if bake.manifest.capture is not None and not method.serves(bake):
        raise BakeError(
            f"it was captured, and '{method.name}' needs {_lacked(method, bake)}",
            where=where,
            fix=f"use one of: {', '.join(available(bake))}",
        )
    if not method.sees_light_of(bake):
        raise BakeError(
            f"it is lit by a light without extent, which '{method.name}' does not see",
            where=where,
            fix=f"use one of: {', '.join(available(bake))}",
        )
    if method.needs.stored_maps and not bake.view_count:
        use = f"`rsibr bake` it first, or use one of: {', '.join(available(bake))}"
        raise BakeError(f"it is not baked, and '{method.name}' reads stored maps", where=where, fix=use)
    if method.needs.lobes and not bake.manifest.lobes:
        fix = f'bake with effects.lobes = "auto" for {method.name}'
        raise BakeError("its lobes are not stored separately", where=where, fix=fix)
    if method.needs.views and not bake.has_views:
        raise BakeError(
            f"it holds one map, because all lobes are predicted from the environment; '{method.name}' needs more views",
            where=where,
            fix='bake with effects.view_dependence = "on", or use another method',
        )
    if method.needs.light and bake.manifest.light is not None and _is_blind(bake):
        raise BakeError(
            f"its maps are lit, and the light that '{method.name}' predicts them from is black: the bake is older than "
            "the support of lights without extent",
            where=where,
            fix="bake anew with --fresh",
        )


def _lacked(method: Registration, bake: StoredMaps) -> str:
    """What a capture does not know."""
    light = method.needs.light and bake.manifest.light is None
    parts = [
        name
        for name, is_lacking in (("the light", light), ("the lobes of the material", method.needs.lobes))
        if is_lacking
    ]
    return " and ".join(parts) + ", which nobody measured" if parts else "another light"


def _should_shine(bake: StoredMaps) -> bool:
    """Whether there is light and a lobe reflects, as far as the bake knows."""
    albedo = np.array([record.albedo for record in bake.manifest.lobes])
    return bool(bake.manifest.light is not None and albedo.any() and not bake.light.is_black)


def _is_blind(bake: StoredMaps) -> bool:
    """Whether maps are lit although the stored light is black."""
    light = bake.manifest.light
    return light is not None and light.delta_lights is None and bake.light.is_black and not is_all_black(bake.manifest)
