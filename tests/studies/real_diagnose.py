# ruff: noqa: E501
"""Diagnose the measured robots: the commands of docs/results.md and what they say."""

from pathlib import Path

from real_robots import DATA, MODELS, Bench, Json, print_values, read_rows, split, write_rows

# Of a cause, its size and what else tells it: a value for each direction, the distance of bristles, the cycles of a ripple.
PARAMETERS_SHOWN = 2


def shown_parameter(p: Json) -> str:
    interval = p.get("ci95") or [None]
    spread = f" ± {0.5 * (interval[1] - interval[0]):.2g}" if None not in interval else ""
    return f"{p['name']} {p['value']:.4g}{spread} {p['unit']}"


def print_cause(cause: Json) -> None:
    told = [p for p in cause["parameters"] if p["name"] != "smoothing"][:PARAMETERS_SHOWN]
    line = f"  {cause['effect']:<28}{cause['where']:<24}{', '.join(map(shown_parameter, told))}"
    for word, others in (("or", cause["class"]), ("rival", cause["rivals"][:1])):
        for c in others:
            line += f"; {word} {c['effect']} at {c['where']} ({c['delta_bic']:+.0f})"
    print(f"{line}; ΔBIC {cause['delta_bic']:.0f}")


def print_finding(result: Json) -> None:
    """First sentence, verdict, causes, held-out torque error (all joints in units of their noise, then each)."""
    gain = result["gain"]
    print(f"  {result['sentence'].split('. ')[0]}")
    print(f"  {result['verdict']}, {len(result['causes'])} causes")
    for cause in result["causes"]:
        print_cause(cause)
    for w in result["witness"]:
        print(f"  rest depends on {', '.join(w['variables'])} at {w['where']}")
    print(
        f"  held out ({result['held_out']}), in units of the noise: "
        f"{gain['test_rmse_before']:.2f} -> {gain['test_rmse_after']:.2f}"
    )
    joints = result["joints"]
    for what in ("base", "extended"):
        rms = {j["joint"]: j[what] for j in joints}
        mean = sum(rms.values()) / len(rms)
        print_values(f"{what} [{joints[0]['unit']}], mean {mean:.4g}", rms, 1, ".4g")
        share = {j["joint"]: 100 * j[what] / j["torque_rms"] for j in joints if j["torque_rms"]}
        if share:
            print_values(f"{what}, of the torque [%]", share, 1, ".2f")
    for h in result["simulated"]["horizons"]:
        print(
            f"  {h['horizon']:.3g} s: error over tolerance {h['base']} -> {h['extended']}, "
            f"apart {h['apart']} of {h['windows']}"
        )
    print(f"  {result['summary']['seconds']:.1f} s")


def diagnose(bench: Bench, title: str, model: Path, *options: object) -> None:
    print_finding(bench.run(title, "diagnose", model, *options)[1])


def emps(bench: Bench) -> None:
    train, test = (DATA / "emps" / f"{name}.csv" for name in ("train", "test"))
    diagnose(bench, "EMPS", MODELS / "emps.urdf", train, "--test", test)


def panda(bench: Bench) -> None:
    first, rest = split(DATA / "panda" / "exciting.csv", 0.6, bench.folder)
    diagnose(
        bench,
        "Panda, first 60 % → rest",
        MODELS / "panda.urdf",
        *(first, "--test", rest, "--torque-side", "link"),
    )


def ur10e(bench: Bench) -> None:
    d = DATA / "ur10e"
    diagnose(
        bench,
        "UR10e, 12harm → ptp",
        d / "ur10e.urdf",
        *(d / "id_50s_12harm.csv", "--test", d / "val_ptp_10_points.csv"),
    )
    for joint, name in ((2, "shoulder lift"), (4, "wrist 1")):
        title = f"UR10e, {name} moves alone"
        diagnose(bench, title, d / "ur10e.urdf", d / f"single_joint{joint}.csv")


def payload(bench: Bench) -> None:
    d = DATA / "ur10e"
    title = "UR10e, 14harm unloaded → loaded"
    run, _ = bench.run(title, "identify", d / "ur10e.urdf", d / "id_50s_14harm_unloaded.csv")
    loaded = d / "id_50s_14harm_load2p805kg.csv"
    diagnose(bench, title, run / "model.json", loaded, "--base", "prior")


def pendulum(bench: Bench) -> None:
    """Without the rows in which a hand leads the pendulum."""
    rows = read_rows(DATA / "pendulum_free_swing" / "free_swing.csv")
    swinging = [row for row in rows if 8.0 <= float(row["time"]) <= 115.0]
    diagnose(
        bench,
        "Pendulum that swings freely, 8 to 115 s",
        MODELS / "pendulum.json",
        write_rows(bench.folder / "swinging.csv", swinging),
    )


def double_pendulum(bench: Bench) -> None:
    d = DATA / "double_pendulum"
    train = [d / f"record_0{k}.csv" for k in range(5)]
    test = [d / f"record_{k}.csv" for k in ("05", "11", "12", "13")]
    diagnose(
        bench,
        "Double pendulum",
        MODELS / "double_pendulum.urdf",
        *(*train, "--test", *test),
    )
