"""The health of a bake as files: `health.html`, `health.json`, and the pictures."""

from __future__ import annotations

from pathlib import Path

from rsibr.store.atomic import unwritable, write_atomic
from rsibr.validation.health.health import Health
from rsibr.validation.health.health_document import HealthModel
from rsibr.validation.report import pictures
from rsibr.validation.report.page import render

PAGE_NAME = "health.html"
JSON_NAME = "health.json"
PICTURES_NAME = "pictures"


def write_health(health: Health, directory: Path) -> Path:
    """Write the findings for a person, for a machine, and as pictures.

    Parameters
    ----------
    health : Health
    directory : Path
        Made where missing. Files of an earlier check are replaced, each at once; the page comes last.

    Returns
    -------
    Path
        The page: `directory / "health.html"`.

    Raises
    ------
    BakeError, MachineError
        If the directory cannot be written.
    """
    write_health_pictures(health, directory)
    write_atomic(directory / JSON_NAME, HealthModel.of(health).to_json().encode())
    write_atomic(directory / PAGE_NAME, render("check.html.j2", health=health).encode())
    return directory / PAGE_NAME


def write_health_pictures(health: Health, directory: Path) -> None:
    """Write `pictures/health_view_0000.png` …, in full size; those of an earlier check go."""
    folder = directory / PICTURES_NAME
    files = {f"health_view_{view:04d}.png": picture for view, picture in health.pictures.items()}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for stale in folder.glob("health_view_[0-9]*.png"):
            if stale.name not in files:
                stale.unlink()
    except OSError as error:
        raise unwritable(folder, error) from error
    for name, picture in files.items():
        write_atomic(folder / name, pictures.png(picture))
