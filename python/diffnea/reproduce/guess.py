"""Where an identification begins: a description that is wrong."""

from __future__ import annotations

import copy

import numpy as np

from .._core import Model

MASS = 0.25  # up to, either way, of every link
INERTIA = 0.25  # about the centre of mass, beside the mass's own factor
CENTRE = 0.015  # of mass, along each axis [m]
ATTACHMENT = 0.010  # of the string, along each axis [m]
LENGTH = 0.02  # of the string [m]


def wrong_guess(model: Model, seed: int) -> Model:
    """Return the model with other masses, centres, inertias and string, all of them possible.

    Errors are those of a careless description, of the size of surrogate A's and in no relation
    to it. Rotor inertias stay: no part of the identification begins from a link's alone.
    """
    rng = np.random.default_rng(seed)
    content = copy.deepcopy(model.to_dict())
    for link in content["links"]:
        inertia = link.get("inertia")
        if not inertia or link["parent"] is None:
            continue
        mass = float(inertia["mass"])
        centre = np.array(inertia["first_moment"]) / mass
        about = _matrix(inertia["about_origin"]) - mass * _spread(centre)
        mass *= _factor(rng, MASS)
        about *= mass / float(inertia["mass"]) * _factor(rng, INERTIA)
        centre = centre + rng.uniform(-CENTRE, CENTRE, 3)
        inertia["mass"] = mass
        inertia["first_moment"] = (mass * centre).tolist()
        inertia["about_origin"] = _upper(about + mass * _spread(centre))
    string = content.get("ball", {}).get("string")
    if string:
        string["length"] += rng.uniform(-LENGTH, LENGTH)
        moved = np.array(string["attachment"]) + rng.uniform(-ATTACHMENT, ATTACHMENT, 3)
        string["attachment"] = moved.tolist()
    return Model.from_dict(content)


def with_string(model: Model, length: float) -> Model:
    """Return the model on whose robot is a string of this nominal length [m]."""
    content = copy.deepcopy(model.to_dict())
    content["ball"]["string"]["length"] = length
    return Model.from_dict(content)


def _factor(rng: np.random.Generator, size: float) -> float:
    """As often greater than 1 as smaller."""
    return float(np.exp(rng.uniform(-1, 1) * np.log1p(size)))


def _spread(p: np.ndarray) -> np.ndarray:
    """Inertia of a unit mass at p about the origin."""
    out: np.ndarray = np.dot(p, p) * np.eye(3) - np.outer(p, p)
    return out


def _matrix(six: list[float]) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _upper(matrix: np.ndarray) -> list[float]:
    return [float(matrix[i, j]) for i in range(3) for j in range(i, 3)]
