# ruff: noqa: E501
"""Length and attachment of a ball's string from a WAM in MuJoCo, by the command; figures of docs/results.md.

    python3 tests/studies/ball_in_mujoco.py build/release/apps/diffnea [--seeds 20] [--lengths 35 40 45]

Massless string (tendon) and rope (chain of 24 capsules, 1.2 g), 40 s of slow motion from `excite`, camera 100 Hz with 1.5 mm of noise. The model that
is fitted has a string of 40 cm tied (7, -8, 4) mm elsewhere. Then the paper's motion (cosines, at 40 cm), and a rope diagnosed with the
massless string as base, against the same fit with the causes known. Needs Python alone. One line a recording; resume is not needed.
"""

import argparse
import json
import math
import statistics
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

Json = dict[str, Any]
MODEL = Path(__file__).resolve().parents[2] / "models" / "wam4_ball.xml"
NOISE = 1.5e-3  # of the camera [m]
LIMITS = ("--velocity-limit", "0.8", "--acceleration-limit", "2", "--duration", "40", "--period", "20",
          *(w for j in ("joint1=-0.8:0.8", "joint2=0.2:1.0", "joint3=-0.8:0.8", "joint4=0.6:1.8") for w in ("--position-limit", j)))  # fmt: skip
ROPE_EFFECTS = "linear_drag,string_mass,string_damping"
BALL_EFFECTS = "linear_drag,quadratic_drag,dry_drag,wind,gravity_scale,string_mass,string_damping,string_bending,string_extension,camera_delay,camera_scale,camera_rotation,camera_offset"
ROPE_MASS = {"light": 0.5, "mid": 1.2, "heavy": 2.25}  # g
BALL_MASS = 24.0  # g
HOME = (0.0, 0.6, 0.0, 1.25)
COSINES = (
    (0.35, 9.0),
    (0.15, 7.0),
    (0.25, 11.0),
    (0.2, 5.0),
)  # of the paper's kind: amplitude [rad], period [s]


class Study:
    def __init__(self, program: Path, folder: Path) -> None:
        self.program, self.folder = program, folder
        wrong = MODEL.read_text(encoding="utf-8").replace(
            'name="string_anchor"', 'name="string_anchor" pos=".007 -.008 .004"'
        )
        self.model = folder / "wrong.xml"
        self.model.write_text(wrong, encoding="utf-8")

    def run(self, *words: object) -> None:
        subprocess.run(
            [self.program, *map(str, words), "--quiet"], check=True, capture_output=True, text=True
        )

    def motion(self, seed: int) -> Path:
        path = self.folder / f"motion_{seed}.csv"
        if not path.exists():
            self.run("excite", MODEL, *LIMITS, "--seed", seed, "--iterations", 40, "-o", path)
        return path

    def record(self, motion: Path, world: str, seed: int) -> Path:
        path = (
            self.folder / "recording.csv"
            if world.startswith("ball=tendon")
            else self.folder / f"recording_{seed}.csv"
        )
        self.run(
            "simulate",
            MODEL,
            "--trajectory",
            motion,
            "--world",
            f"mujoco:wam4_ball,perturb=none,{world}",
            "--seed",
            seed,
            "-o",
            path,
        )
        return path

    def identify(self, data: Path, effects: str) -> Json:
        run = self.folder / "run"
        self.run("identify", self.model, data, "--effects", effects, "-o", run)
        return self.result(run)

    def diagnose(self, data: Path, test: Path, effects: str) -> Json:
        run = self.folder / "run"
        self.run("diagnose", self.model, data, "--test", test, "--effects", effects, "-o", run)
        return self.result(run)

    @staticmethod
    def result(run: Path) -> Json:
        out: Json = json.loads((run / "result.json").read_text(encoding="utf-8"))
        return out


def cosine_motion(path: Path) -> Path:
    """The paper's slow cosine trajectory, from rest at home."""
    rows = [
        "time,"
        + ",".join(f"{c}_joint{j}" for c in ("qcmd", "qdcmd", "qddcmd") for j in range(1, 5))
    ]
    for k in range(20001):
        t, q, qd, qdd = k / 500, [], [], []
        for home, (a, period) in zip(HOME, COSINES, strict=True):
            w = 2 * math.pi / period
            q.append(home + a * (1 - math.cos(w * t)) - a)
            qd.append(a * w * math.sin(w * t))
            qdd.append(a * w * w * math.cos(w * t))
        rows.append(",".join(f"{v:.9g}" for v in (t, *q, *qd, *qdd)))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def string_errors(result: Json, length: float) -> tuple[float, float, float]:
    """Errors of length and attachment [m], and the residual over the noise."""
    p = {q["name"]: q["value"] for q in result["parameters"]}
    place = math.sqrt(sum(p[f"string.attachment_{c}"] ** 2 for c in "xyz"))
    return abs(p["string.length"] - length), place, result["ball"]["extended_rms"] / NOISE


def print_errors(what: str, errors: Iterable[tuple[float, float, float]]) -> None:
    r, place, left = (sorted(e) for e in zip(*errors, strict=True))
    print(
        f"{what:<40} {len(r):3d} recordings: r off by {1e3 * statistics.median(r):.2f} mm (median), {1e3 * r[-1]:.2f} (largest);"
        f" p_E by {1e3 * statistics.median(place):.2f}, {1e3 * place[-1]:.2f};"
        f" residual / noise {statistics.median(left):.3f}, {left[-1]:.3f}",
        flush=True,
    )


def lengths(study: Study, centimetres: list[int], seeds: int) -> None:
    for cm in centimetres:
        for world, effects in (
            ("tendon", "linear_drag"),
            ("chain", "linear_drag"),
            ("chain", ROPE_EFFECTS),
        ):
            errors = []
            for seed in range(seeds):
                data = study.folder / f"{world}_{cm}_{seed}.csv"
                if not data.exists():
                    study.record(
                        study.motion(seed), f"ball={world},string={cm / 100}", seed
                    ).rename(data)
                errors.append(string_errors(study.identify(data, effects), cm / 100))
            print_errors(f"{cm} cm, {world}, {effects}", errors)


def cosines(study: Study, seeds: int) -> None:
    motion = cosine_motion(study.folder / "cosines.csv")
    for world, effects in (("tendon", "linear_drag"), ("chain", ROPE_EFFECTS)):
        errors = [
            string_errors(
                study.identify(study.record(motion, f"ball={world},string=0.4", s), effects), 0.4
            )
            for s in range(seeds)
        ]
        print_errors(f"cosines, {world}, {effects}", errors)


def ropes(study: Study, seeds: int) -> None:
    for rope, mass in ROPE_MASS.items():
        for seed in range(seeds):
            data, test = (
                study.record(study.motion(s), f"ball=chain,string=0.4,rope={rope}", s)
                for s in (seed, seed + 1000)
            )
            found = study.diagnose(data, test, BALL_EFFECTS)
            oracle = study.diagnose(data, test, "string_mass,string_damping")
            names = [
                c["effect"]
                + ("" if not c["class"] else " or " + " or ".join(r["effect"] for r in c["class"]))
                for c in found["causes"]
            ]
            before, after, best = (
                r["ball"][k] ** 2
                for r, k in ((found, "base_rms"), (found, "extended_rms"), (oracle, "extended_rms"))
            )
            share = (before - after) / (before - best) if before > best else math.nan
            ratio = next(
                (
                    p["value"]
                    for c in found["causes"]
                    for p in c["parameters"]
                    if p["name"] == "mass_ratio"
                ),
                math.nan,
            )
            print(
                f"rope {rope} (mass ratio {mass / BALL_MASS:.3f}), seed {seed}: {found['verdict']} {', '.join(names)}; mass ratio {ratio:.3f};"
                f" error over noise {math.sqrt(before) / NOISE:.3f} -> {math.sqrt(after) / NOISE:.3f}, {share:.2f} of the oracle's gain",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("program", type=Path, help="the command diffnea")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--lengths", type=int, nargs="*", default=[35, 40, 45], help="[cm]")
    parser.add_argument("--only", choices=("lengths", "cosines", "ropes"))
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        study = Study(args.program.resolve(), Path(folder))
        if args.only in (None, "lengths"):
            lengths(study, args.lengths, args.seeds)
        if args.only in (None, "cosines"):
            cosines(study, max(1, args.seeds // 4))
        if args.only in (None, "ropes"):
            ropes(study, max(1, args.seeds // 4))


if __name__ == "__main__":
    main()
