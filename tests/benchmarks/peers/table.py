# ruff: noqa: E501
"""OUT/*.json as tables in Markdown: OUT/table.md and results.json, all in one.

table.py OUT
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
from pathlib import Path
from typing import Any

Json = dict[str, Any]


def processor() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return f"{line.split(': ')[1]}, {os.cpu_count()} cores"
    return platform.processor()


def rows(header: list[str], lines: list[list[str]]) -> str:
    out = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    out += ["| " + " | ".join(line) + " |" for line in lines]
    return "\n".join(out) + "\n"


def number(x: float | None, digits: int = 3) -> str:
    if x is None:
        return "–"
    return f"{x:.{digits}g}" if abs(x) < 10**digits else f"{x:.0f}"


def dynamics(result: Json) -> str:
    best: dict[str, float] = {}
    for r in result["rows"]:
        best[r["quantity"]] = min(best.get(r["quantity"], 1e9), r["cpu_us"])
    lines = [
        [
            r["quantity"],
            r["by"],
            f"**{r['cpu_us']:.2f}**"
            if r["cpu_us"] == best[r["quantity"]]
            else f"{r['cpu_us']:.2f}",
            f"{r['best_wall_us']:.2f}",
        ]
        for r in result["rows"]
    ]
    head = f"{result['states']} states, median of {result['rounds']} rounds (wall clock: best round)\n\n"
    return head + rows(["", "by", "processor time a state [µs]", "wall clock [µs]"], lines)


def relative(r: Json, which: str, rows_of: str) -> list[float]:
    e = r["errors"][which]
    return [100.0 * x / t for x, t in zip(e[rows_of], e["torque"], strict=True)]


def identification(results: list[Json]) -> str:
    out = ""
    for case in dict.fromkeys(r["case"] for r in results):
        chosen = [r for r in results if r["case"] == case]
        lines = []
        for r in chosen:
            if "failed" in r:
                lines.append([r["tool"], f"failed: `{r['failed'][:150]}`", *["–"] * 7])
                continue
            c = r["consistency"]
            impossible = (
                "no link's values"
                if c["impossible"] is None
                else f"{c['impossible']} of {c['links']}"
            )
            if r["errors"]:
                mean = statistics.mean(r["errors"]["test"]["all"])
                moving = statistics.mean(r["errors"]["test"]["moving"])
                joints = " ".join(f"{x:.1f}" for x in relative(r, "test", "all"))
                errors = [f"{mean:.3f}", f"{moving:.3f}", joints]
            else:
                errors = ["–"] * 3
            name = r["tool"] + (
                " (not finished)" if any("not finished" in n for n in r["notes"]) else ""
            )
            lines.append(
                [
                    name,
                    *errors,
                    impossible,
                    number(r["cpu"]),
                    number(r["process_cpu"]),
                    number(r["grown_mb"]),
                    number(r["process_mb"]),
                ]
            )
        head = [
            "by",
            "all rows",
            "moving",
            "joint by joint, of the torque [%]",
            "impossible links",
            "fit [s]",
            "process [s]",
            "fit [MB]",
            "process [MB]",
        ]
        out += f"**{chosen[0]['title']}**\n\n{rows(head, lines)}\n"
    return out


def causes(results: list[Json]) -> str:
    lines = [
        [
            r["case"],
            r["tool"],
            ", ".join(r["causes"]) or r["says"],
            f"{number(r['noises_before'])} → {number(r['noises_after'])}",
        ]
        for r in results
        if r.get("causes") is not None
    ]
    return rows(["case", "by", "what is lacking", "error checked [noises]"], lines)


def rollouts(result: Json) -> str:
    lines = [
        [
            r["by"],
            r["how"],
            str(r["batch"]),
            r["threads"],
            f"{r['per_cpu_second']:.3g}"
            if r["per_cpu_second"] < 1000
            else f"{r['per_cpu_second']:.0f}",
            f"{r['best_per_second']:.3g}"
            if r["best_per_second"] < 1000
            else f"{r['best_per_second']:.0f}",
            f"{r['compile_cpu']:.0f}" if r["compile_cpu"] else "–",
        ]
        for r in result["rows"]
    ]
    head = [
        "by",
        "how",
        "batch",
        "threads",
        "rollouts a processor second",
        "a second (best round)",
        "compiling [processor s]",
    ]
    out = rows(head, lines) + "\n"
    near = [
        [a["by"], f"{a['ball_rms_mm']:.3f}", f"{a['longest_mm']:.3f}"] for a in result["accuracy"]
    ]
    out += rows(["", "ball off RK4 at 0.1 ms, rms [mm]", "string too long by [mm]"], near)
    return out + "".join(f"\nfailed: {f}\n" for f in result["failures"])


def servos(results: list[Json]) -> str:
    out = ""
    for case in dict.fromkeys(r["case"] for r in results):
        chosen = [r for r in results if r["case"] == case]
        splits = next((list(r["errors"]["own"]) for r in chosen if "errors" in r), [])
        lines = []
        for r in chosen:
            if "failed" in r:
                lines.append(
                    [r["tool"], f"failed: `{r['failed'][:150]}`", *["–"] * (3 + len(splits) + 2)]
                )
                continue
            e = r["errors"]
            cross = [
                ", ".join(f"{e[judge][s]:.3g}" for s in splits[1:]) for judge in ("numpy", "mujoco")
            ]
            near = (
                f"{number(r['near_seconds'])} ({r['near_evaluations']})"
                if "near_seconds" in r
                else "–"
            )
            off = "–"
            if r["truth"]:
                # A drive that is always on tells the sum of what brakes.
                law = r["law"] | {"damping": r["law"]["damping"] + r["law"]["viscous"]}
                off = " ".join(f"{100.0 * (law[n] / v - 1.0):+.1f}" for n, v in r["truth"].items())
            lines.append(
                [
                    r["tool"],
                    number(r["cpu"]),
                    near,
                    str(r.get("evaluations", "–")),
                    *(f"{e['own'][s]:.3g}" for s in splits),
                    *cross,
                    off,
                ]
            )
        head = [
            "by",
            "processor [s]",
            "within 1 % of its last score after [s] (simulations of all runs)",
            "simulations of all runs",
            *(f"{s} [mrad]" for s in splits),
            "held out, by NumPy",
            "held out, by MuJoCo",
            "off the truth [%]: " + ", ".join(chosen[0]["truth"])
            if chosen[0]["truth"]
            else "off the truth",
        ]
        out += f"**{chosen[0]['title']}**\n\n{rows(head, lines)}\n"
        out += "".join(f"- {r['tool']}: {n}\n" for r in chosen for n in r.get("notes", [])) + "\n"
    return out


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    args = parser.parse_args()
    parts = {
        "dynamics": dynamics,
        "identify": identification,
        "servos": servos,
        "rollouts": rollouts,
    }
    text = f"{processor()}; Python {platform.python_version()}\n"
    together: Json = {"processor": processor()}
    for name, table in parts.items():
        path = args.out / f"{name}.json"
        if not path.is_file():
            continue
        together[name] = json.loads(path.read_text(encoding="utf-8"))
        text += f"\n## {name}\n\n{table(together[name])}"
        if name == "identify":
            text += f"\n{causes(together[name])}"
    (args.out / "table.md").write_text(text, encoding="utf-8")
    (args.out / "results.json").write_text(json.dumps(together, indent=1), encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
