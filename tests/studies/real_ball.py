# ruff: noqa: E501
"""Table-tennis flights (Gossard et al. 2023): drag, lift, and the spins that the flights contradict."""

import csv
import json
import math
import statistics
from collections import defaultdict
from pathlib import Path

from real_robots import DATA, MODELS, Bench, Json, read_rows

MODEL = MODELS / "table_tennis.json"
AIR, MASS, RADIUS = 1.2, 0.0027, 0.02  # kg/m³, kg, m
SPIN = ("spin_x", "spin_y", "spin_z")


def drag_coefficient(drag: float) -> float:
    """C_D of c₂ [1/m]."""
    return 2.0 * drag * MASS / (AIR * math.pi * RADIUS**2)


def write_flights(folder: Path) -> tuple[Path, Path, list[int]]:
    """Even runs to fit, odd ones held out, each row with its flight's spin."""
    spins = {int(r["run"]): r for r in read_rows(DATA / "table_tennis" / "spin.csv")}
    paths = folder / "even.csv", folder / "odd.csv"
    held_out: list[int] = []
    rows: tuple[list[list[str]], list[list[str]]] = ([], [])
    for r in read_rows(DATA / "table_tennis" / "flights.csv"):
        run = int(r["run"])
        part = sorted(spins).index(run) % 2
        if part == 1 and run not in held_out:
            held_out.append(run)
        ball = [r[c] for c in ("run", "time", "ball_x", "ball_y", "ball_z")]
        rows[part].append([*ball, *(spins[run][c] for c in SPIN)])
    for path, lines in zip(paths, rows, strict=True):
        with path.open("w", encoding="utf-8", newline="") as f:
            writer = csv.writer(f)
            writer.writerow(["run", "time", "ball_x", "ball_y", "ball_z", *SPIN])
            writer.writerows(lines)
    return *paths, held_out


def flight_errors(run: Path, key: str) -> dict[int, float]:
    """Root mean square distance of each held-out flight [m]."""
    ball: Json = json.loads((run / "series.json").read_text(encoding="utf-8"))["ball"]
    squares: dict[int, list[float]] = defaultdict(list)
    for i, flight in enumerate(ball["run"]):
        squares[flight].append(sum((ball["measured"][c][i] - ball[key][c][i]) ** 2 for c in "xyz"))
    return {flight: math.sqrt(statistics.mean(s)) for flight, s in squares.items()}


def print_errors(what: str, errors: dict[int, float], clean: set[int]) -> None:
    for words, chosen in (
        ("", list(errors.values())),
        (", marked clean", [errors[f] for f in errors if f in clean]),
    ):
        v = sorted(1e3 * e for e in chosen)
        print(
            f"  {what + words:<44}{len(v):3d} flights, median {statistics.median(v):.1f} mm, 90 % {v[int(0.9 * len(v))]:.1f} mm"
        )


def print_flags(result: Json) -> None:
    reasons = {
        "spin: impossible": "times the ball's speed",
        "spin: contradicted by the flight": "contradicted",
        "after a bounce": "bounce",
        "rows off their neighbours": "neighbours",
        "rows off any path": "off its path",
        "flights off any path": "on no path",
    }
    flagged = [f["reason"] for f in result["ball"]["flagged"]]
    counts = {words: sum(key in f for f in flagged) for words, key in reasons.items()}
    print("  flagged: " + ", ".join(f"{n} {words}" for words, n in counts.items() if n))


def table_tennis(bench: Bench) -> None:
    train, test, held_out = write_flights(bench.folder)
    spins = {int(r["run"]): r for r in read_rows(DATA / "table_tennis" / "spin.csv")}
    clean = {k for k, run in enumerate(held_out) if spins[run]["clean"] == "1"}
    for effects in ("none", "quadratic_drag", "quadratic_drag,magnus"):
        run, result = bench.run(
            f"flights, {effects}", "identify", MODEL, train, "--test", test, "--effects", effects
        )
        for p in result["parameters"] + [q for e in result["effects"] for q in e["parameters"]]:
            print(f"  {p['name']:<44}{p['value']:.4f} ± {p['std'] or 0.0:.4f}")
            if p["name"] == "drag":
                print(f"  {'C_D':<44}{drag_coefficient(p['value']):.3f}")
        print_errors("held out", flight_errors(run, "extended"), clean)
        print_flags(result)
    run, result = bench.run("flights, diagnosed", "diagnose", MODEL, train, "--test", test)
    print(f"  {result['verdict']}: {result['sentence']}")
    print_errors("held out, gravity alone", flight_errors(run, "base"), clean)
    print_errors("held out, extended", flight_errors(run, "extended"), clean)
    print_flags(result)
