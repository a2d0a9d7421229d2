"""Faces that do not fit at their edges are noticed; right cubes, with a sun on an edge too, are not accused."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.geometry.projections.latlong import MITSUBA
from rsibr.geometry.projections.projection import projection
from rsibr.geometry.projections.sphere_image import SphereImage, converted
from rsibr.methods.kautz2003.claims import small_sun
from rsibr.resources import scenes
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.latlong import read_latlong
from rsibr.scene.panorama.face_borders import unfit_faces
from tests.scene.cube_faces import DIRECTIONS, face, write_faces
from tests.scene.maps import write_exr

CUBE = projection("cube")
SKIES = ("city", "courtyard", "studio", "sunset")
SIDE = 64


@pytest.fixture(scope="module")
def cubes():
    """Faces of the shipped environments, each made once."""
    images = {name: read_latlong(scenes() / "environments" / f"{name}.exr").image for name in SKIES}
    return {name: converted(SphereImage(MITSUBA, image[None]), CUBE, SIDE).values for name, image in images.items()}


def smooth(side=32):
    return np.stack([face(name, side) for name in DIRECTIONS]).astype(np.float32)


def sunny(direction, sky):
    return small_sun(SIDE, np.array(direction) / np.linalg.norm(direction)) + sky


def glowing(direction):
    """A sun of radiance 10⁵ with a halo of some degrees, on faces of `SIDE`²."""
    place = (np.arange(SIDE) + 0.5) / SIDE * 2 - 1
    x, y = np.meshgrid(place, -place)
    d = np.stack([np.stack(of(x, y), axis=-1) for of in DIRECTIONS.values()])
    cosine = d @ np.array(direction) / np.linalg.norm(d, axis=-1) / np.linalg.norm(direction)
    return (1e5 * np.exp(300 * (cosine - 1)))[..., None] * np.ones(3)


@pytest.mark.parametrize("sky", SKIES)
def test_right_cubes_fit(cubes, sky):
    assert unfit_faces(cubes[sky], CUBE) == ""


RIGHT = {
    "smooth": smooth,
    "a lone sun on an edge": lambda: smooth(SIDE) + sunny((1, 1, 0.01), 0),
    "a glowing sun on an edge": lambda: smooth(SIDE) + glowing((1, 0, 0.998)),
    "at a corner": lambda: sunny((1, 1, 1), 0.1),
    "in the dark": lambda: sunny((1, 0.999, 0.3), 0),
    "noise": lambda: np.random.default_rng(3).exponential(1, (6, 32, 32, 3)),
    "even": lambda: np.ones((6, 16, 16, 3)),
    "black": lambda: np.zeros((6, 16, 16, 3)),
    "too small to judge": lambda: np.ones((6, 1, 1, 3)) * np.arange(6).reshape(6, 1, 1, 1),
}


@pytest.mark.parametrize("name", list(RIGHT))
def test_right_cubes_of_our_own_fit(name):
    assert unfit_faces(RIGHT[name](), CUBE) == ""


@pytest.mark.parametrize("sky", SKIES)
def test_a_face_turned_by_90_degrees_is_named(cubes, sky):
    for index, name in enumerate(DIRECTIONS):
        faces = cubes[sky].copy()
        faces[index] = np.rot90(faces[index])
        said = unfit_faces(faces, CUBE)
        assert "check that none is turned" in said, name
        assert name in said


@pytest.mark.parametrize("sky", SKIES)
def test_swapped_faces_are_noticed(cubes, sky):
    assert "do" in unfit_faces(cubes[sky][[0, 1, 3, 2, 4, 5]], CUBE)
    assert "do" in unfit_faces(cubes[sky][[4, 1, 2, 3, 0, 5]], CUBE)


def test_the_other_orientation_of_faces_is_noticed(cubes):
    assert unfit_faces(cubes["city"], projection("cube-openexr"))


def test_it_is_a_note_of_the_environment(tmp_path):
    faces = write_faces(tmp_path)
    write_exr(faces["py"], np.rot90(face("py", 32)))
    notes = load_environment(EnvironmentConfig(faces=faces)).notes
    assert any(note.startswith("its face py does not fit its neighbours at ") for note in notes)
