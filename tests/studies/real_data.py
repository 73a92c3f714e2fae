# ruff: noqa: E501
"""Identify the measured robots, by the command, and print the figures of docs/results.md.

    python3 tests/studies/real_data.py build/release/apps/diffnea [NAME …]

NAME: emps, panda, ur10e, payload, double_pendulum; all if none is given. The recordings are not part of the project:
DIFFNEA_DATA names their folder, else ../shared/data beside the project. Needs Python alone. Every command is printed.
"""

import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("DIFFNEA_DATA", SOURCE.parent / "shared" / "data"))
MODELS = SOURCE / "models"
PROGRAM = ""


def identify(title, folder, model, train, *options):
    """Run `diffnea identify`, print the command, return result.json."""
    run = folder / f"run_{len(list(folder.glob('run_*')))}"
    files = [str(f) for f in (train if isinstance(train, list) else [train])]
    arguments = ["identify", str(model), *files, *map(str, options), "-o", str(run)]
    shown = " ".join(
        a.replace(str(folder), "TMP").replace(str(DATA), "DATA").replace(str(SOURCE) + "/", "")
        for a in arguments
    )
    print(f"\n{title}\n  $ diffnea {shown}", flush=True)
    done = subprocess.run(
        [PROGRAM, *arguments, "--quiet", "--json"], capture_output=True, text=True
    )
    if done.returncode != 0:
        print(f"  exit code {done.returncode}: {done.stderr.strip()}")
    result = json.loads((run / "result.json").read_text())
    return run, result


def joints_line(what, values, scale=1.0, digits=3):
    print(
        f"  {what:<44}"
        + "  ".join("–" if v is None else f"{scale * v:.{digits}f}" for v in values.values())
    )


def percent(result, which):
    """Torque error over the torque itself, per joint [%]."""
    rms = result["rmse"]
    return {j: 100 * rms[which][j] / rms["torque_rms"][j] for j in rms[which]}


def error_lines(result):
    """Of moving rows (train, test), of all rows, of all rows with the torque unfiltered."""
    for which in ("train", "test", "test_all", "test_raw"):
        joints_line(f"{which}, of the torque [%]", percent(result, which), 1, 2)
    p = result["preprocessing"]
    print(f"  filter {p['filter_hz']:.2f} Hz, decimated to {p['decimated_to_hz']:.1f} Hz")


def values(result, *endings):
    for p in result["parameters"]:
        if p["name"].endswith(endings) and not p["name"].endswith("smoothing"):
            std = f" ± {1.96 * p['std']:.4g}" if p["std"] else ""
            print(f"  {p['name']:<48}{p['value']:.5g}{std} {p['unit']}")


def parameter(result, name):
    return next(p for p in result["parameters"] if p["name"] == name)


def split(path, share, folder):
    """The first rows and the rest, as two files."""
    lines = path.read_text().splitlines()
    cut = 1 + int(share * (len(lines) - 1))
    first, rest = folder / f"{path.stem}_first.csv", folder / f"{path.stem}_rest.csv"
    first.write_text("\n".join(lines[:cut]) + "\n")
    rest.write_text("\n".join([lines[0], *lines[cut:]]) + "\n")
    return first, rest


def emps(folder):
    # The drive's voltage is sampled with the position in the literature's recipe: no half a period of hold.
    files = []
    for name in ("train", "test"):
        files.append(folder / f"{name}.csv")
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
    recipe = folder / "emps_sign.json"
    recipe.write_text(json.dumps(model))
    _, r = identify(
        "EMPS, the literature's recipe: sign(qd), 100 Hz, decimated by 10",
        folder,
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
        _, r = identify(
            "EMPS, project's own",
            folder,
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


def panda(folder):
    first, rest = split(DATA / "panda" / "exciting.csv", 0.6, folder)
    for title, more in (("10 Hz", ["--filter", 10]), ("automatic filter", [])):
        _, r = identify(
            f"Panda, first 60 % fitted, last 40 % held out, {title}",
            folder,
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
            joints_line(f"{which} [N·m], mean {sum(rms.values()) / len(rms):.4f}", rms)
        p = r["preprocessing"]
        print(f"  filter {p['filter_hz']:.2f} Hz, decimated to {p['decimated_to_hz']:.1f} Hz")


def ur10e(folder):
    d = DATA / "ur10e"
    for extra in ("", ",sublinear_friction"):
        effects = "armature,viscous_friction,coulomb_friction,torque_offset" + extra
        _, r = identify(
            "UR10e, 12harm fitted, ptp held out",
            folder,
            d / "ur10e.urdf",
            d / "id_50s_12harm.csv",
            "--test",
            d / "val_ptp_10_points.csv",
            "--effects",
            effects,
        )
        error_lines(r)
        values(r, "wrist_3_joint.torque_offset.offset")


def double_pendulum(folder):
    d = DATA / "double_pendulum"
    train = [d / f"record_0{k}.csv" for k in range(5)]
    test = [d / f"record_{k}.csv" for k in ("05", "11", "12", "13")]
    _, r = identify(
        "Double pendulum, trajectory loss",
        folder,
        MODELS / "double_pendulum.urdf",
        train,
        "--test",
        *test,
        "--loss",
        "trajectory",
        "--window",
        0.4,
        "--effects",
        "viscous_friction,coulomb_friction,armature",
    )
    for which in ("train", "test", "test_raw"):
        if which in r["rmse"]:
            joints_line(f"{which} [mrad]", r["rmse"][which], 1e3, 2)
    print(f"  {r['summary']['seconds']:.1f} s, {r['summary']['termination']}")


OTHER_K = (
    10.0,
    10.70,
    8.46,
    9.00,
    9.48,
    10.12,
)  # [N·m/A], published like those of the logged torques


def with_torque_constants(path, constants, folder):
    """The run with tau = K times current."""
    with path.open() as f:
        header, *rows = csv.reader(f)
    tau = [i for i, name in enumerate(header) if name.startswith("tau_")]
    current = [i for i, name in enumerate(header) if name.startswith("current_")]
    for row in rows:
        for t, c, k in zip(tau, current, constants, strict=True):
            row[t] = repr(k * float(row[c])) if row[c] else ""
    out = folder / f"{path.stem}_other_K.csv"
    with out.open("w", newline="") as f:
        csv.writer(f).writerows([header, *rows])
    return out


def payload(folder):
    d = DATA / "ur10e"
    runs = [d / "id_50s_14harm_unloaded.csv", d / "id_50s_14harm_load2p805kg.csv"]
    for title, files in (
        ("K of the logged torques", runs),
        ("the other published K", [with_torque_constants(f, OTHER_K, folder) for f in runs]),
    ):
        run, _ = identify(
            f"UR10e payload, {title}: unloaded",
            folder,
            d / "ur10e.urdf",
            files[0],
            "--effects",
            "armature,viscous_friction,coulomb_friction,torque_offset,sublinear_friction",
        )
        _, r = identify(
            f"UR10e payload, {title}: loaded, all but the payload held",
            folder,
            run / "model.json",
            files[1],
            "--effects",
            "payload@tip",
            "--fit",
            "effects",
            "--fix",
            "*friction*",
            "*armature*",
            "*offset*",
        )
        values(r, "payload.mass")
        print(
            f"  truth 2.805 kg: {100 * (parameter(r, 'tip.payload.mass')['value'] / 2.805 - 1):+.1f} %"
        )


STUDIES = {
    "emps": emps,
    "panda": panda,
    "ur10e": ur10e,
    "payload": payload,
    "double_pendulum": double_pendulum,
}


def main():
    global PROGRAM
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    PROGRAM = sys.argv[1]
    if not DATA.is_dir():
        print(f"no measured recordings at {DATA}; DIFFNEA_DATA may name their folder")
        return
    for name in sys.argv[2:] or STUDIES:
        with tempfile.TemporaryDirectory() as folder:
            STUDIES[name](Path(folder))


main()
