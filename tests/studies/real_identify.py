# ruff: noqa: E501
"""Identify the measured robots: the commands of docs/results.md and their figures."""

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from real_robots import DATA, MODELS, Bench, Json, Row, print_values, read_rows, split, write_rows


def identify(
    bench: Bench, title: str, model: Path, train: Path | list[Path], *options: object
) -> Json:
    files = train if isinstance(train, list) else [train]
    return bench.run(title, "identify", model, *files, *options)[1]


def percent(result: Json, which: str) -> dict[str, float]:
    """Torque error over the torque itself, per joint [%]."""
    rms = result["rmse"]
    return {j: 100 * rms[which][j] / rms["torque_rms"][j] for j in rms[which]}


def error_lines(result: Json) -> None:
    """Of moving rows (train, test), of all rows, of all rows with the torque unfiltered."""
    for which in ("train", "test", "test_all", "test_raw"):
        print_values(f"{which}, of the torque [%]", percent(result, which), 1, ".2f")
    p = result["preprocessing"]
    print(f"  filter {p['filter_hz']:.2f} Hz, decimated to {p['decimated_to_hz']:.1f} Hz")


def values(result: Json, *endings: str) -> None:
    for p in result["parameters"]:
        if p["name"].endswith(endings) and not p["name"].endswith("smoothing"):
            std = f" ± {1.96 * p['std']:.4g}" if p["std"] else ""
            print(f"  {p['name']:<48}{p['value']:.5g}{std} {p['unit']}")


def emps(bench: Bench) -> None:
    # The drive's voltage is sampled with the position in the literature's recipe: no half a period of hold.
    files = []
    for name in ("train", "test"):
        files.append(bench.folder / f"{name}.csv")
        shutil.copy(DATA / "emps" / f"{name}.csv", files[-1])
        files[-1].with_suffix(".json").write_text(
            json.dumps({"schema": "diffnea/recording/1", "torque_sampling": "instant"})
        )
    # sign(qd): Coulomb friction with a smoothing that no sample sees.
    model = {
        "schema": "diffnea/model/1",
        "name": "emps",
        "links": [
            {"name": "base", "joint": {"type": "fixed"}},
            {
                "name": "carriage",
                "parent": "base",
                "joint": {"name": "carriage", "type": "prismatic", "axis": [1, 0, 0]},
                "inertia": {"mass": 95.1, "about_com": [1, 0, 0, 1, 0, 1]},
            },
        ],
        "effects": [
            {
                "effect": "coulomb_friction",
                "where": "carriage",
                "parameters": [
                    {"name": "coulomb", "value": 0.0},
                    {"name": "smoothing", "value": 1e-9},
                ],
            }
        ],
    }
    recipe = bench.folder / "emps_sign.json"
    recipe.write_text(json.dumps(model))
    r = identify(
        bench,
        "EMPS, the literature's recipe: sign(qd), 100 Hz, decimated by 10",
        recipe,
        files[0],
        "--test",
        files[1],
        "--filter",
        100,
        "--decimate",
        100,
        "--effects",
        "viscous_friction,torque_offset",
    )
    values(r, ".mass", ".viscous", ".coulomb", ".offset")
    error_lines(r)
    original = [DATA / "emps" / f"{n}.csv" for n in ("train", "test")]
    own = "asymmetric_viscous,coulomb_friction,torque_offset"
    same_band = ["--filter", 100, "--decimate", 100]
    for effects, more in (
        (own, []),
        (own + ",sublinear_friction", []),
        (own + ",sublinear_friction", same_band),
    ):
        r = identify(
            bench,
            "EMPS, project's own",
            MODELS / "emps.urdf",
            original[0],
            "--test",
            original[1],
            "--effects",
            effects,
            *more,
        )
        values(
            r,
            ".mass",
            ".viscous_positive",
            ".viscous_negative",
            ".coulomb",
            ".sublinear",
            ".offset",
        )
        error_lines(r)


def panda(bench: Bench) -> None:
    first, rest = split(DATA / "panda" / "exciting.csv", 0.6, bench.folder)
    for title, more in (("10 Hz", ["--filter", 10]), ("automatic filter", [])):
        r = identify(
            bench,
            f"Panda, first 60 % fitted, last 40 % held out, {title}",
            MODELS / "panda.urdf",
            first,
            "--test",
            rest,
            "--torque-side",
            "link",
            "--effects",
            "armature,viscous_friction,coulomb_friction,torque_offset",
            *more,
        )
        for which in ("train", "test", "test_all", "test_raw"):
            rms = r["rmse"][which]
            print_values(f"{which} [N·m], mean {sum(rms.values()) / len(rms):.4f}", rms, 1, ".3f")
        p = r["preprocessing"]
        print(f"  filter {p['filter_hz']:.2f} Hz, decimated to {p['decimated_to_hz']:.1f} Hz")


def ur10e(bench: Bench) -> None:
    d = DATA / "ur10e"
    for extra in ("", ",sublinear_friction"):
        effects = "armature,viscous_friction,coulomb_friction,torque_offset" + extra
        r = identify(
            bench,
            "UR10e, 12harm fitted, ptp held out",
            d / "ur10e.urdf",
            d / "id_50s_12harm.csv",
            "--test",
            d / "val_ptp_10_points.csv",
            "--effects",
            effects,
        )
        error_lines(r)
        values(r, "wrist_3_joint.torque_offset.offset")


def double_pendulum(bench: Bench) -> None:
    d = DATA / "double_pendulum"
    train = [d / f"record_0{k}.csv" for k in range(5)]
    test = [d / f"record_{k}.csv" for k in ("05", "11", "12", "13")]
    r = identify(
        bench,
        "Double pendulum, motion loss",
        MODELS / "double_pendulum.urdf",
        train,
        "--test",
        *test,
        "--loss",
        "motion",
        "--horizon",
        0.4,
        "--effects",
        "viscous_friction,coulomb_friction,armature",
    )
    for which in ("train", "test", "test_raw"):
        if which in r["rmse"]:
            print_values(f"{which} [mrad]", r["rmse"][which], 1e3, ".2f")
    print(f"  {r['summary']['seconds']:.1f} s, {r['summary']['termination']}")


def parameter(result: Json, name: str) -> Json:
    return next(p for p in result["parameters"] if p["name"] == name)


# [N·m/A]: of the logged torques, and of another publication.
LOGGED_K = (14.87, 13.26, 11.13, 10.62, 11.03, 11.47)
OTHER_K = (10.0, 10.70, 8.46, 9.00, 9.48, 10.12)
UR10E = [
    f"{j}_joint"
    for j in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
]
LOAD = 2.805  # kg
FRICTION = "armature,viscous_friction,coulomb_friction,torque_offset,sublinear_friction"


def with_torque_constants(path: Path, constants: Sequence[float], folder: Path, name: str) -> Path:
    """The run with tau = K times current, and a sidecar that names K."""
    rows = read_rows(path)
    for row in rows:
        for joint, k in zip(UR10E, constants, strict=True):
            current = row[f"current_{joint}"]
            row[f"tau_{joint}"] = repr(k * float(current)) if current else ""
    out = write_rows(folder / f"{path.stem}_{name}.csv", rows)
    constant = dict(zip(UR10E, constants, strict=True))
    out.with_suffix(".json").write_text(
        json.dumps({"schema": "diffnea/recording/1", "torque_constant": constant})
    )
    return out


def mass_of_load(
    bench: Bench,
    title: str,
    files: list[Path],
    *options: str,
    effects: str = FRICTION,
    stated: bool = True,
) -> Json:
    """Joint fit of the runs without and with the load; prints its mass against 2.805 kg."""
    r = identify(
        bench,
        f"UR10e payload, {title}",
        DATA / "ur10e" / "ur10e.urdf",
        files,
        "--effects",
        effects + ",payload@tip:run=1",
        *options,
    )
    m = parameter(r, "tip:run=1.payload.mass")
    std = m["std"] or 0.0
    print(
        f"  mass {m['value']:.3f} ± {1.96 * std:.3f} kg, "
        f"{'truth' if stated else 'if it is the body of 14harm:'} {LOAD}: {100 * (m['value'] / LOAD - 1):+.1f} %"
    )
    return r


def stands(folder: Path) -> Path:
    """Where the robot stands for a second and more, clear of the person who pushes; each its own run."""
    where = {
        "contact_push_pose1": [(0.0, 2.2), (6.2, 8.7), (9.8, 12.4), (13.5, 18.3)],
        "val_ptp_10_points": [(0.2, 6.2), (47.3, 57.0)],
        "single_joint2": [(62.4, 64.3)],
        "single_joint4": [(64.3, 67.0)],
        "id_50s_12harm": [(0.1, 2.2), (54.5, 58.0)],
        "id_50s_14harm_unloaded": [(52.5, 56.3)],
        "id_50s_15harm_unloaded": [(53.5, 56.0)],
    }
    rows: list[Row] = []
    for name, windows in where.items():
        for first, last in windows:
            run = rows[-1]["run"] + 1 if rows else 0
            for row in read_rows(DATA / "ur10e" / f"{name}.csv"):
                if first <= float(row["time"]) <= last:
                    keep = {k: v for k, v in row.items() if k[:2] in ("ti", "q_", "ta")}
                    rows.append(keep | {"run": run})
    return write_rows(folder / "stands.csv", rows)


def manufacturers_model(folder: Path) -> Path:
    """The URDF with masses and centers of mass of the upper arm and forearm as the manufacturer's description has them.

    Universal_Robots_ROS2_Description, config/ur10e/physical_parameters.yaml. The URDF of the data has midpoints.
    """
    masses = {
        "shoulder_link": (7.369, None),
        "upper_arm_link": (13.051, 0.38757),
        "forearm_link": (3.989, 0.1984),
        "wrist_1_link": (2.1, None),
        "wrist_2_link": (1.98, None),
        "wrist_3_link": (0.615, None),
    }
    tree = ElementTree.parse(DATA / "ur10e" / "ur10e.urdf")
    for link in tree.getroot().findall("link"):
        if link.get("name") in masses:
            mass, along = masses[link.get("name")]
            link.find("inertial/mass").set("value", str(mass))
            if along:
                link.find("inertial/origin").set("xyz", f"0 0 {along}")
    out = folder / "manufacturer.urdf"
    tree.write(out)
    return out


def payload(bench: Bench) -> None:
    d = DATA / "ur10e"
    names = ["id_50s_14harm_unloaded", "id_50s_14harm_load2p805kg"]
    runs = [d / f"{n}.csv" for n in names]

    def pair(constants: Sequence[float], name: str) -> list[Path]:
        return [with_torque_constants(f, constants, bench.folder, name) for f in runs]

    logged = pair(LOGGED_K, "logged_K")
    mass_of_load(bench, "K of the logged torques", logged)
    mass_of_load(bench, "the other published K", pair(OTHER_K, "other_K"))

    # K from standstill: what the links weigh over the current that holds them. Joints whose gain the stands do not
    # tell to 15 % keep their K.
    standing = stands(bench.folder)
    for name, model in (
        ("URDF", d / "ur10e.urdf"),
        ("manufacturer", manufacturers_model(bench.folder)),
    ):
        r = identify(
            bench,
            f"UR10e, K from standstill and the masses of the {name}",
            model,
            standing,
            *("--fit", "effects", "--effects", "torque_gain", "--filter", 5, "--decimate", 10),
        )
        values(r, ".gain_error")
        gains = [parameter(r, f"{j}.torque_gain.gain_error") for j in UR10E]
        told = [g["identifiable"] and g["std"] < 0.15 for g in gains]
        k = [
            k / (1 + g["value"]) if t else k for k, g, t in zip(LOGGED_K, gains, told, strict=True)
        ]
        print("  K " + " ".join(f"{x:.2f}" for x in k))
        mass_of_load(
            bench,
            f"K from standstill, masses of the {name}",
            pair(k, f"standing_K_{name}"),
        )

    # The URDF's masses against the whole motion.
    r = identify(
        bench,
        "UR10e, K from the motion without load and the URDF's masses",
        d / "ur10e.urdf",
        logged[0],
        *("--fit", "effects,armature", "--effects", FRICTION + ",torque_gain"),
    )
    values(r, ".gain_error")
    # A gain that the run does not tell is held and not listed.
    told_by_motion = {k["joint"]: k["value"] for k in r["torque_constants"]}
    moving = [told_by_motion.get(j, k) for j, k in zip(UR10E, LOGGED_K, strict=True)]
    mass_of_load(bench, "K from the motion and the URDF's masses", pair(moving, "moving_K"))

    r = mass_of_load(
        bench,
        "the load known, torque constants fitted",
        logged,
        *("--fix", f"*payload.mass={LOAD}"),
        effects=FRICTION + ",torque_gain",
    )
    for k in r["torque_constants"]:
        print(
            f"  K of {k['joint']:<22}{k['assumed']:.2f} -> {k['value']:.2f} ± {1.96 * k['std']:.2f} {k['unit']}"
        )

    # Those K on another session: its load is not stated, but is likely the same one.
    calibrated = [k["value"] for k in r["torque_constants"]]
    runs = [
        d / f"{n}.csv" for n in ("id_50s_15harm_unloaded", "id_50s_15harm_loaded_mass_unstated")
    ]
    for name, constants in (("logged", LOGGED_K), ("calibrated", calibrated)):
        files = pair(constants, f"{name}_15")
        mass_of_load(bench, f"15harm, mass not stated, {name} K", files, stated=False)
