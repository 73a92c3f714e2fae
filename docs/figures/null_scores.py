"""Scores of what is not there, against χ²: the calibration of a diagnosis.

    python3 docs/figures/null_scores.py qq.svg build/none [build/none_rigs ...]

Reads the results of studies that hide nothing (tests/hidden_effects/study.py --group none). Of
every candidate of one parameter without shapes the score is distributed as χ² with one degree of
freedom; where the parameter cannot be negative, it is 0 in half of the cases (Chernoff 1954).
Prints quantiles, draws them. One recording has some tens of candidates, which are not independent.
"""

import json
import sys
from pathlib import Path
from statistics import NormalDist

import matplotlib as mpl

import diffnea

mpl.use("Agg")
from matplotlib import pyplot as plt

SHARES = (0.5, 0.75, 0.9, 0.95, 0.99, 0.999)


def chi_square(p: float, *, signed: bool) -> float:
    """Quantile of χ²₁; of 0 and χ²₁ in equal parts where a sign is known."""
    if signed:
        p = max(0.0, 2.0 * p - 1.0)
    return NormalDist().inv_cdf(0.5 * (1.0 + p)) ** 2


def scores(folders: list[Path]) -> dict[bool, list[float]]:
    """Scores of candidates of one parameter, by whether its sign is known, ascending."""
    signed = {}
    for effect in diffnea.effects():
        if len(effect["parameters"]) == 1:
            signed[effect["effect"]] = effect["parameters"][0]["sign"] != "any"
    out: dict[bool, list[float]] = {False: [], True: []}
    for folder in folders:
        for file in sorted(folder.glob("*/result.json")):
            result = json.loads(file.read_text(encoding="utf-8"))
            for c in result["candidates"]:
                if c["effect"] in signed and not c["shape"] and c["visible_share"] > 0.01:
                    out[signed[c["effect"]]].append(c["lm"])
    return {known: sorted(values) for known, values in out.items()}


def main() -> None:
    picture, folders = Path(sys.argv[1]), [Path(word) for word in sys.argv[2:]]
    figure, axis = plt.subplots(figsize=(4.2, 4.0), layout="constrained")
    words = {False: "either sign", True: "sign known"}
    print("| quantile | " + " | ".join(f"{words[k]}: χ² | observed" for k in words) + " |")
    print("|---|" + "---|" * (2 * len(words)))
    found = scores(folders)
    for share in SHARES:
        row = [f"{100 * share:g} %"]
        for known, values in found.items():
            row.append(f"{chi_square(share, signed=known):.2f}")
            row.append(f"{values[int(share * (len(values) - 1))]:.2f}" if values else "–")
        print("| " + " | ".join(row) + " |")
    for known, values in found.items():
        n = len(values)
        print(f"{words[known]}: {n} scores")
        expected = [chi_square((k + 0.5) / n, signed=known) for k in range(n)]
        axis.plot(expected, values, ".", markersize=3, label=f"{words[known]} ({n})")
    most = max(axis.get_xlim()[1], 1.0)
    axis.plot([0, most], [0, most], color="0.6", linewidth=1)
    axis.set(xlabel="quantile of χ²", ylabel="quantile of the scores")
    axis.legend(frameon=False)
    figure.savefig(picture)


if __name__ == "__main__":
    main()
