"""Plots of OUT/results.json in OUT/plots: error over time, torques held out, rollouts.

plots.py OUT
"""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt

Json = dict[str, Any]
COLORS = {"diffnea": "C0", "least squares": "C2", "FIGAROH": "C1", "mujoco.sysid": "C3"}


def color(name: str) -> str:
    return next((c for key, c in COLORS.items() if name.startswith(key)), "0.5")


def error_over_time(results: list[Json], folder: Path) -> None:
    cases = list(dict.fromkeys(r["case"] for r in results))
    figure, panels = plt.subplots(1, len(cases), figsize=(4.2 * len(cases), 3.6), squeeze=False)
    for panel, case in zip(panels[0], cases, strict=True):
        for r in results:
            if r["case"] == case and r.get("errors"):
                at = r["cpu"], statistics.mean(r["errors"]["test"]["all"])
                panel.loglog(*at, "o", color=color(r["tool"]))
                panel.annotate(r["tool"], at, fontsize=5, xytext=(3, 3), textcoords="offset points")
        panel.set(title=case, xlabel="processor time of the fit [s]")
    panels[0][0].set_ylabel("held-out torque error, mean of joints [N·m, N]")
    figure.tight_layout()
    figure.savefig(folder / "identify.svg")
    plt.close(figure)


def torques(out: Path, results: list[Json], folder: Path) -> None:
    """What is left of the held-out torques, of each tool's first variant."""
    chosen = {"diffnea": "stock", "least_squares": "wls", "figaroh": "physical_given"}
    for case in dict.fromkeys(r["case"] for r in results):
        joints = next(r["joints"] for r in results if r["case"] == case)
        figure, panels = plt.subplots(
            len(joints), 1, figsize=(9, 1.4 * len(joints) + 1), sharex=True, squeeze=False
        )
        for worker, variant in chosen.items():
            path = out / "identify" / case / f"{worker}_{variant}.npz"
            if path.is_file():
                data = np.load(path)
                for j, panel in enumerate(panels[:, 0]):
                    miss = data["measured"][:, j] - data["predicted"][:, j]
                    panel.plot(data["time"], miss, lw=0.7, label=f"{worker} {variant}")
                    panel.set_ylabel(joints[j], fontsize=7)
        panels[0, 0].legend(fontsize=6, ncol=3)
        panels[-1, 0].set_xlabel("time [s]; measured less predicted torque [N·m, N]")
        figure.tight_layout()
        figure.savefig(folder / f"held_out_{case}.svg")
        plt.close(figure)


def rollouts(result: Json, folder: Path) -> None:
    names = [f"{r['by']}\n{r['how']}, batch {r['batch']}, {r['threads']}" for r in result["rows"]]
    figure, panel = plt.subplots(figsize=(8, 0.45 * len(names) + 1))
    panel.barh(names[::-1], [r["per_cpu_second"] for r in result["rows"]][::-1])
    panel.set_xscale("log")
    panel.set_xlabel("rollouts of 2.5 s a processor second")
    panel.tick_params(axis="y", labelsize=6)
    figure.tight_layout()
    figure.savefig(folder / "rollouts.svg")
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    args = parser.parse_args()
    results: Json = json.loads((args.out / "results.json").read_text(encoding="utf-8"))
    folder = args.out / "plots"
    folder.mkdir(exist_ok=True)
    if "identify" in results:
        error_over_time(results["identify"], folder)
        torques(args.out, results["identify"], folder)
    if "rollouts" in results:
        rollouts(results["rollouts"], folder)
    print(f"plots in {folder}")


if __name__ == "__main__":
    main()
