"""Random robots and recordings, most of them odd and many of them absurd: all that a seed says."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import diffnea

Json = dict[str, Any]

EFFECTS = {
    "viscous_friction": {"viscous": 0.5},
    "coulomb_friction": {"coulomb": 0.5},
    "quadratic_friction": {"quadratic": 0.1},
    "torque_offset": {"offset": 0.5},
    "joint_spring": {"stiffness": 1.0, "rest": 0.3},
    "cogging": {"sine": 0.3, "cosine": 0.2, "cycles": 7.0},
    "armature": {"armature": 0.05},
}
"""Torques that the robot may have and its model may lack, and how much of them is usual."""
CANDIDATES = (*EFFECTS, "payload@tip", "base_tilt", "stribeck_friction", "backlash")


@dataclass
class Case:
    """A description, recordings as CSV and what is asked of them."""

    model: Json
    files: list[Path]
    sidecar: Json | None
    task: str
    options: Json
    test: bool
    words: str
    """What it is, for the log."""


def make(seed: int, folder: Path) -> Case:
    """Write the recordings of a seed and describe what to do with them."""
    rng = np.random.default_rng(seed)
    n = int(rng.choice([1, 2, 3, 4, 6], p=[0.35, 0.3, 0.2, 0.1, 0.05]))
    ball = rng.random() < 0.15
    free = ball and rng.random() < 0.3
    n = 0 if free else n
    model = random_robot(rng, n)
    truth = perturbed(rng, model)
    if ball:
        model["ball"] = random_ball(rng, model, free)
    files = []
    dirt: list[str] = []
    for k in range(int(rng.choice([1, 2, 3], p=[0.6, 0.3, 0.1]))):
        columns = record(rng, truth, n)
        if ball:
            add_ball(rng, columns, model)
        dirt += soil(rng, columns)
        files.append(folder / f"{k}.csv")
        write(rng, columns, files[-1])
    joints = [link["joint"]["name"] for link in model["links"] if "joint" in link]
    sidecar: Json | None = None
    if rng.random() < 0.3:
        sidecar = {"torque_side": str(rng.choice(["motor", "link"]))}
        sidecar["period"] = float(rng.choice([0.0, 0.1, 1.0, 100.0]))
        if joints and rng.random() < 0.3:
            sidecar["passive"] = [str(rng.choice(joints))]
    task = str(rng.choice(["diagnose", "identify"], p=[0.7, 0.3]))
    options = diagnosis(rng) if task == "diagnose" else identification(rng, ball=ball)
    kind = "free ball" if free else "ball" if ball else "arm"
    words = f"{task} {kind} n={n} files={len(files)} {' '.join(dirt)} {options}"
    return Case(model, files, sidecar, task, options, len(files) > 1 and rng.random() < 0.5, words)


def diagnosis(rng: np.random.Generator) -> Json:
    out: Json = {
        "base": str(rng.choice(["auto", "refit", "fixed", "prior"], p=[0.7, 0.15, 0.12, 0.03]))
    }
    if rng.random() < 0.5:
        count = int(rng.integers(1, 4))
        out["effects"] = [str(e) for e in rng.choice(CANDIDATES, count, replace=False)]
    out["grey_box"] = bool(rng.random() < 0.3)
    if rng.random() < 0.1:
        out["filter_hz"] = float(rng.choice([1e-3, 1.0, 5.0, 10.0, 20.0, 1e5]))
    if rng.random() < 0.1:
        out["decimate_to_hz"] = float(rng.choice([1e-3, 1.0, 10.0, 20.0, 1e5]))
    return out


def identification(rng: np.random.Generator, *, ball: bool) -> Json:
    """Options that act: another one is wrong usage."""
    losses = ["inverse", "forward", "motion", "constrained"]
    loss = str(rng.choice(losses, p=[0.5, 0.2, 0.2, 0.1]))
    if loss == "constrained" and not ball:
        loss = "inverse"
    out: Json = {"loss": loss}
    if loss == "motion":
        out["horizon"] = float(rng.choice([0.0, 0.01, 0.2, 0.5, 100.0]))
    else:
        out["robust"] = str(rng.choice(["none", "huber", "cauchy"]))
        if rng.random() < 0.2:
            out["entropic_prior"] = float(rng.choice([0.0, 1e-6, 1.0, 1e9]))
    if rng.random() < 0.2:
        out["effects"] = []
    if rng.random() < 0.2:
        out["fit"] = ["inertia", "effects", "kinematics"]
    return out


# --- robots


def random_robot(rng: np.random.Generator, n: int) -> Json:
    """A tree of n joints: hinges and slides, now and then a link without mass."""
    links: list[Json] = []
    for k in range(n):
        parent = links[int(rng.integers(k))]["name"] if k and rng.random() < 0.2 else None
        if k and parent is None:
            parent = links[k - 1]["name"]
        kind = "prismatic" if rng.random() < 0.25 else "revolute"
        joint: Json = {"name": f"j{k}", "type": kind, "axis": axis(rng)}
        joint["pose"] = {
            "position": list(rng.normal(scale=0.3, size=3)),
            "rpy": list(rng.uniform(-math.pi, math.pi, 3)) if rng.random() < 0.5 else [0, 0, 0],
        }
        if rng.random() < 0.5:
            joint["limits"] = {"lower": -2.0, "upper": 2.0, "velocity": 5.0, "effort": 50.0}
        if rng.random() < 0.05:
            joint["passive"] = True
        link: Json = {"name": f"l{k}", "joint": joint, "inertia": inertia(rng)}
        if parent is not None:
            link["parent"] = parent
        links.append(link)
    out: Json = {"schema": "diffnea/model/1", "name": "soak", "links": links, "effects": []}
    out["gravity"] = [0, 0, float(rng.choice([-9.81, 0.0]))]
    if n and rng.random() < 0.3:
        out["effects"].append(effect(rng, n))
    return out


def axis(rng: np.random.Generator) -> list[float]:
    if rng.random() < 0.7:
        return [float(x) for x in np.eye(3)[rng.integers(3)]]
    x = rng.normal(size=3)
    return [float(c) for c in x / np.linalg.norm(x)]


def inertia(rng: np.random.Generator) -> Json:
    if rng.random() < 0.05:
        return {"mass": 0.0}
    mass = float(10.0 ** rng.uniform(-2, 1.5))
    points = rng.normal(scale=0.1, size=(8, 3))  # of a cloud: physically consistent
    com = points.mean(axis=0) + rng.normal(scale=0.1, size=3)
    points -= points.mean(axis=0)
    second = mass * points.T @ points / len(points)
    tensor = np.trace(second) * np.eye(3) - second
    upper = [tensor[0, 0], tensor[0, 1], tensor[0, 2], tensor[1, 1], tensor[1, 2], tensor[2, 2]]
    if rng.random() < 0.03:
        upper[0] *= -1  # impossible
    return {"mass": mass, "com": list(com), "about_com": upper}


def effect(rng: np.random.Generator, n: int) -> Json:
    name = str(rng.choice(list(EFFECTS)))
    values = {
        key: usual * float(10.0 ** rng.uniform(-1.5, 1.0)) for key, usual in EFFECTS[name].items()
    }
    where = f"j{rng.integers(n)}"
    parameters = [{"name": key, "value": value} for key, value in values.items()]
    return {"effect": name, "where": where, "parameters": parameters}


def perturbed(rng: np.random.Generator, model: Json) -> Json:
    """The robot that was recorded: heavier or lighter links, effects that the model lacks."""
    links = []
    for link in model["links"]:
        scale = float(rng.uniform(0.7, 1.4)) if rng.random() < 0.5 else 1.0
        own = dict(link["inertia"])
        own["mass"] *= scale
        if "about_com" in own:
            own["about_com"] = [
                abs(own["about_com"][0]) * scale,
                *(scale * x for x in own["about_com"][1:]),
            ]
        links.append(link | {"inertia": own})
    effects = list(model["effects"])
    for _ in range(int(rng.choice([0, 1, 2], p=[0.3, 0.5, 0.2]))):
        if links:
            effects.append(effect(rng, len(links)))
    return model | {"links": links, "effects": effects}


def random_ball(rng: np.random.Generator, model: Json, free: bool) -> Json:
    out: Json = {"mass": float(10.0 ** rng.uniform(-3, 0)), "radius": 0.02}
    if not free:
        out["string"] = {"length": float(rng.choice([0.05, 0.3, 0.4, 2.0]))}
        if model["links"] and rng.random() < 0.8:
            out["string"]["link"] = model["links"][-1]["name"]
    return out


# --- recordings


def record(rng: np.random.Generator, truth: Json, n: int) -> dict[str, np.ndarray]:
    """What the robot's sensors see of a motion of sines."""
    if rng.random() < 0.7:  # as people record
        rate = float(rng.choice([50.0, 100.0, 200.0]))
        rows = int(rate * rng.uniform(8.0, 30.0))
    else:
        rows = int(rng.choice([1, 2, 3, 7, 20, 60, 200, 600, 1500, 4000]))
        rate = float(rng.choice([0.1, 5.0, 50.0, 250.0, 1000.0, 1e5]))
    t = np.arange(rows) / rate
    seconds = max(rows / rate, 1e-3)
    q, qd, qdd = (np.zeros((rows, n)) for _ in range(3))
    for j in range(n):
        for _ in range(int(rng.integers(0, 5))):
            w = 2 * math.pi * rng.uniform(0.2, 12.0) / seconds
            if rng.random() < 0.7:
                w = 2 * math.pi * rng.uniform(0.1, 2.0) * min(1.0, rate / 8)
            a, p = rng.normal(scale=0.5), rng.uniform(0, 2 * math.pi)
            if rng.random() < 0.9:  # of a robot that keeps to its drives
                a *= min(1.0, 30.0 / w**2)
            q[:, j] += a * np.sin(w * t + p)
            qd[:, j] += a * w * np.cos(w * t + p)
            qdd[:, j] -= a * w * w * np.sin(w * t + p)
    columns = {"time": t}
    if n == 0:
        return columns
    try:
        robot = diffnea.Model.from_dict(truth)
        tau = diffnea.rnea(robot, q=q, qd=qd, qdd=qdd, effects=True)
    except diffnea.Error:  # an impossible robot: any torque will do
        tau = rng.normal(size=q.shape)
    noise = float(rng.choice([0.0, 1e-9, 1e-3, 0.03, 3.0], p=[0.15, 0.05, 0.3, 0.4, 0.1]))
    tau = tau + noise * rng.normal(size=tau.shape)
    q = q + float(rng.choice([0.0, 1e-5, 1e-2])) * rng.normal(size=q.shape)
    for j in range(n):
        columns[f"q_j{j}"] = q[:, j]
    for j in range(n):
        columns[f"tau_j{j}"] = tau[:, j]
    if rng.random() < 0.2:
        for j in range(n):
            columns[f"qd_j{j}"] = qd[:, j]
    return columns


def add_ball(rng: np.random.Generator, columns: dict[str, np.ndarray], model: Json) -> None:
    t = columns["time"]
    string = model["ball"].get("string")
    p = rng.normal(scale=0.3, size=3)
    if string is None:
        v = rng.normal(scale=2.0, size=3)
        path = p + np.outer(t, v) + 0.5 * np.outer(t**2, model["gravity"])
    else:
        swing = 0.3 * np.sin(3.0 * t + 1.0)
        length = string["length"]
        path = p + length * np.stack([np.sin(swing), 0 * t, -np.cos(swing)], axis=1)
    path = path + 1e-3 * rng.normal(size=path.shape)
    if rng.random() < 0.5:  # a camera is slower
        path[np.arange(len(t)) % 5 != 0] = np.nan
    for k, name in enumerate("xyz"):
        columns[f"ball_{name}"] = path[:, k]


def soil(rng: np.random.Generator, columns: dict[str, np.ndarray]) -> list[str]:
    """Spoil some of it, as logs are spoilt; the names of what was done."""
    done: list[str] = []
    if rng.random() < 0.4:
        return done
    for name, share, action in DIRT:
        if rng.random() < share and len(columns["time"]):
            action(rng, columns)
            done.append(name)
    return done


def some_column(rng: np.random.Generator, columns: dict[str, np.ndarray]) -> str:
    names = [name for name in columns if name != "time"]
    return str(rng.choice(names)) if names else "time"


def gaps(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    name = some_column(rng, c)
    if name != "time":
        begin = int(rng.integers(len(c[name])))
        c[name][begin : begin + int(rng.integers(1, 200))] = np.nan


def holes_in_time(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    at = int(rng.integers(len(c["time"])))
    c["time"][at:] += float(rng.choice([0.1, 3.0, 1e4]))


def jitter(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    step = np.median(np.diff(c["time"])) if len(c["time"]) > 1 else 1.0
    c["time"] += step * rng.choice([0.01, 0.3, 0.7]) * rng.random(len(c["time"]))


def far_time(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    c["time"] += float(rng.choice([-50.0, 1.7e9, 1e15]))


def constant(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    name = some_column(rng, c)
    if name != "time":
        c[name][:] = float(rng.choice([0.0, 1.0, -0.3]))


def spikes(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    name = some_column(rng, c)
    rows = rng.integers(len(c[name]), size=int(rng.integers(1, 6)))
    c[name][rows] = rng.choice([1e3, 1e6, -1e12, 1e300, np.inf, 5e-324], size=len(rows))


def coarse(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    name = some_column(rng, c)
    step = float(rng.choice([1e-3, 0.1, 2.0]))
    c[name][:] = step * np.round(c[name] / step)


def frozen(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    name = some_column(rng, c)
    at = int(rng.integers(len(c[name])))
    if name != "time":
        c[name][at:] = c[name][at]


def exchanged(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    a, b = some_column(rng, c), some_column(rng, c)
    c[a], c[b] = c[b], c[a]


def huge(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    c[some_column(rng, c)] *= float(rng.choice([57.3, 1e3, 1e-6, 1e8, -1.0]))


def repeated(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    rows = np.sort(rng.integers(len(c["time"]), size=len(c["time"])))
    for name in c:
        c[name] = c[name][rows]


def lost(rng: np.random.Generator, c: dict[str, np.ndarray]) -> None:
    name = some_column(rng, c)
    if name != "time":
        del c[name]


DIRT = (
    ("gaps", 0.25, gaps),
    ("hole", 0.1, holes_in_time),
    ("jitter", 0.15, jitter),
    ("far", 0.1, far_time),
    ("constant", 0.12, constant),
    ("spikes", 0.1, spikes),
    ("coarse", 0.15, coarse),
    ("frozen", 0.08, frozen),
    ("exchanged", 0.05, exchanged),
    ("scaled", 0.08, huge),
    ("repeated", 0.03, repeated),
    ("lost", 0.06, lost),
)


def write(rng: np.random.Generator, columns: dict[str, np.ndarray], path: Path) -> None:
    """As CSV; now and then in two runs, or broken off in its last row."""
    rows = len(columns["time"])
    runs = np.arange(rows) * 2 // max(rows, 1) if rng.random() < 0.1 else None
    names = [*columns, *(["run"] if runs is not None else [])]
    lines = [",".join(names)]
    for k in range(rows):
        cells = ["" if math.isnan(v[k]) else repr(float(v[k])) for v in columns.values()]
        lines.append(",".join(cells + ([str(runs[k])] if runs is not None else [])))
    text = "\n".join(lines) + "\n"
    if rng.random() < 0.05:
        text = text[: -int(rng.integers(1, 20))]
    path.write_text(text, encoding="utf-8")
