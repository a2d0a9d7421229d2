"""Spectra in a config: found in plugins as plain data or XML, and read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy import constants

from rsibr.errors import InputError
from rsibr.scene.mitsuba_bsdf import bsdf_data
from rsibr.scene.paint.car_paint import PLUGIN as CAR_PAINT
from rsibr.scene.paint.pigments import pigment_spectrum
from rsibr.scene.paint.spectra import NODES
from rsibr.scene.spectrum_file import read_spectrum

Samples = list[tuple[float, float]]
"""Wavelengths [nm] and values, ascending; linear between them and zero beyond."""

METALS = ("conductor", "roughconductor")
"""BSDFs that accept a measured metal by name."""

_GRID = np.linspace(360.0, 830.0, 95)


def found_spectra(source: Mapping[str, Any] | Path | None, where: str) -> Iterator[tuple[str, Samples]]:
    """Find the spectra that vary with wavelength in a plugin and its nested plugins.

    Parameters
    ----------
    source : mapping, Path or None
        A plugin as plain data, or path of a Mitsuba XML file.
    where : str
        Origin that an error names.

    Yields
    ------
    str, Samples
        Name of the parameter, and its spectrum: a table, a file, a black body or a named pigment of a car paint.

    Raises
    ------
    InputError
        If a spectrum is invalid.
    """
    for name, plugin in _plugins(source):
        if (samples := _read(plugin, where)) is not None:
            yield name, samples
        if plugin.get("type") == CAR_PAINT and isinstance(plugin.get("pigment"), str):
            values = pigment_spectrum(plugin["pigment"], NODES)
            yield plugin["pigment"], list(zip(NODES.tolist(), values.tolist(), strict=True))


def found_metals(source: Mapping[str, Any] | Path | None) -> Iterator[str]:
    """Find the names of the measured metals in a material."""
    for _, plugin in _plugins(source):
        if plugin.get("type") in METALS and isinstance(name := plugin.get("material"), str) and name != "none":
            yield name


def planckian(temperature: float) -> Samples:
    """Radiance [W sr⁻¹ m⁻² nm⁻¹] of a black body at a temperature [K], by Planck's law."""
    metres = _GRID * 1e-9
    with np.errstate(over="ignore"):
        exponential = np.expm1(constants.h * constants.c / (metres * constants.k * temperature))
        radiance = 2e-9 * constants.h * constants.c**2 / (metres**5 * exponential)
    return list(zip(_GRID.tolist(), radiance.tolist(), strict=True))


def in_every_variant(plugin: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Replace black bodies by tables: Mitsuba supports them in its spectral variants only."""

    def written(value: Any) -> Any:
        if not isinstance(value, Mapping):
            return value
        if value.get("type") != "blackbody":
            return {key: written(item) for key, item in value.items()}
        return {"type": "spectrum", "value": [list(pair) for pair in _read(value, where) or ()]}

    return {key: written(item) for key, item in plugin.items()}


def _plugins(source: Mapping[str, Any] | Path | None, name: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """All plugins of a source, each with its name in the enclosing plugin."""
    plugin = bsdf_data(source, str(source)) if isinstance(source, Path) else source or {}
    yield name, plugin
    for key, value in plugin.items():
        if isinstance(value, Mapping):
            yield from _plugins(value, key)


def _read(plugin: Mapping[str, Any], where: str) -> Samples | None:
    """Samples of a spectrum plugin; None if it is another plugin or constant over wavelengths."""
    try:
        match plugin:
            case {"type": "spectrum", "value": [*pairs]}:
                samples = [(float(wavelength), float(value)) for wavelength, value in pairs]
            case {"type": "spectrum", "filename": file}:
                samples = read_spectrum(Path(str(file)), where)
            case {"type": "irregular", "wavelengths": wavelengths, "values": values}:
                samples = _zipped(_numbers(wavelengths), _numbers(values))
            case {"type": "regular", "wavelength_min": low, "wavelength_max": high, "values": values}:
                samples = _zipped(np.linspace(float(low), float(high), len(_numbers(values))), _numbers(values))
            case {"type": "blackbody", "temperature": temperature}:
                samples = planckian(float(temperature))
            case _:
                return None
    except (TypeError, ValueError, RuntimeError):
        raise InputError("holds a spectrum that is none", where=where, fix="give [[wavelength, value], …]") from None
    return sorted(samples)


def _numbers(text: Any) -> list[float]:
    return [float(number) for number in (text.replace(",", " ").split() if isinstance(text, str) else text)]


def _zipped(wavelengths: Any, values: Any) -> Samples:
    return [(float(w), float(v)) for w, v in zip(wavelengths, values, strict=True)]
