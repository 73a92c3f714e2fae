"""The study's page: one file that needs no network."""

from __future__ import annotations

import base64
import html
import os
import platform
import shlex
import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from .. import _core
from .._files import load_model
from .._readers.packages import install_command
from . import figures
from .jobs import Json, Results, write_text
from .table import HEAD, cells, percent, spread_of
from .table1 import KINDS, ROBOT, SIMULATION, TITLES, TRAINED, Study
from .traces import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_page(path: Path, study: Study, table: Json, results: Results) -> None:
    """Write table, pictures and what they were made by."""
    parts = [
        "<h1>Ball in a cup, offline: which models transfer</h1>",
        f'<p class="verdict">{html.escape(verdict(table))}</p>',
        *_warnings(table),
        _table(table),
        *_pictures(study, results),
        *_cost(table),
        made_by(table["cost"]["builds"]),
    ]
    write_text(path, frame("table1", parts))


def frame(title: str, parts: Sequence[str]) -> str:
    """Return a page of these parts, styles included."""
    css = resources.files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    body = "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{css}</style></head>\n<body><main>\n{body}\n</main></body></html>\n"
    )


def verdict(table: Json) -> str:
    """Return the finding in a sentence or two: shares of all policies, none chosen."""
    parts = []
    systems = list(dict.fromkeys((row["system"], row["length"]) for row in table["rows"]))
    for system, length in systems:
        rows = {
            r["model"]: r
            for r in table["rows"]
            if (r["system"], r["length"]) == (system, length) and not r["not_run"]
        }
        if not rows:
            continue
        said = [f"{TITLES[kind]} {_share(rows[kind])}" for kind in reversed(KINDS) if kind in rows]
        where = "in simulation" if system == SIMULATION else f"on surrogate {system}"
        parts.append(f"{where}, {100 * length:.0f} cm: {', '.join(said)}")
    if not parts:
        return "Nothing was transferred yet."
    text = f"Of all policies these are in the cup at the end: {'; '.join(parts)}."
    trained = [r for r in table["rows"] if r["model"] in TRAINED and not r["not_run"]]
    if trained and not any(r["all"]["transfer"]["value"] for r in trained):
        text += " No network's policy transfers."
    elif trained:
        text += " Policies of networks do transfer."
    else:
        text += " Networks were not run."
    return text


def _share(row: Json) -> str:
    found = row["all"]["transfer"]
    return f"{percent(found['value'])} ({100 * found['low']:.0f}–{100 * found['high']:.0f})"


def _warnings(table: Json) -> list[str]:
    out = []
    missing = sum(r["asked"] - r["policies"] for r in table["rows"])
    if missing:
        asked = sum(r["asked"] for r in table["rows"])
        out.append(f"{missing} of {asked} policies are not there yet; the same command goes on.")
    for row in table["rows"]:
        if row["not_run"] and row["not_run"] != "not run yet":
            out.append(f"{TITLES[row['model']]}: {row['not_run']}.")
    out += [f"{name} failed: {why}." for name, why in table["failed"].items()]
    out += several_builds(table["cost"]["builds"])
    few = min((r["models"] for r in table["rows"] if not r["not_run"]), default=0)
    if 0 < few < 5:
        out.append(
            f"Intervals are over {few} {'models' if few > 1 else 'model'} a row: too few to know"
            " how models differ."
        )
    return [f'<p class="warning">{html.escape(text)}</p>' for text in dict.fromkeys(out)]


def several_builds(builds: Sequence[str]) -> list[str]:
    """Return the warning, if there is a reason for one."""
    if len(builds) < 2:
        return []
    return [f"The results are of several builds of the library ({', '.join(builds)})."]


def _table(table: Json) -> str:
    def tag(name: str, k: int, text: str) -> str:
        kind = ' class="paper"' if HEAD[k].startswith("paper") else ""
        return f"<{name}{kind}>{html.escape(text)}</{name}>"

    lines, before = [], None
    for row in table["rows"]:
        where = (row["system"], row["length"])
        first = ' class="first"' if where != before else ""
        before = where
        body = "".join(tag("td", k, cell) for k, cell in enumerate(cells(row)))
        lines.append(f"<tr{first}>{body}</tr>")
    head = "".join(tag("th", k, name) for k, name in enumerate(HEAD))
    after = "; ".join(
        f"{TITLES[r['model']]} {r['system']} {100 * r['length']:.0f} cm"
        f" {spread_of(r['best']['chosen_after'])}"
        for r in table["rows"]
        if not r["not_run"]
    )
    notes = (
        "Rewards at ε = 0.055 m², the scale of the paper's. Best ten: of each model's policies the"
        " ten with the largest reward <em>in the model</em>, mean ± standard deviation over all of"
        " these; nothing of the transfer chooses them. All: every policy, with 95 % intervals from"
        " a bootstrap over models and the policies in each; shares with at least Wilson's width."
        " Transferred: the ball is in the cup throughout the last half second. Repeatability: of"
        " the best policy of each model, repeated with noise of drives and posture. Paper: its"
        " robot beside the surrogates, which are MuJoCo worlds that the models do not know."
    )
    chosen = (
        f" Ten with the largest reward <em>obtained</em>, instead: {html.escape(after)}."
        if after
        else ""
    )
    return (
        f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody>'
        f'</table></div><p class="faint">{notes}{chosen}</p>'
    )


def _pictures(study: Study, results: Results) -> list[str]:
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        return [
            '<p class="warning">There are no pictures: matplotlib is not installed'
            f" ({html.escape(install_command('plots'))}; then the same command again).</p>"
        ]
    rows = [row for row in study.rows if row.units]
    if not rows:
        return []
    model = load_model(ROBOT)
    out = [
        "<h2>Expected and obtained</h2>",
        _picture(
            lambda: figures.scatter(rows, results),
            "Reward in the model against reward in the world; filled: in the cup. " + _keys(),
        ),
        "<h2>Movements</h2>",
        '<p class="faint">From the side: the ball as the model imagined it (orange) and as it was'
        " (blue). Of each row, the best policy of the first model.</p>",
    ]
    for row in rows:
        movement = shown(row, results)
        if movement is not None:
            said = f"{row.title}: {movement.policy['text'] or movement.policy['outcome']}"
            strip = partial(figures.film_strip, model, movement)
            out.append(_picture(strip, html.escape(said)))
    identified = next(
        (
            (unit.identified, unit.recorded)
            for row in reversed(rows)
            for unit in row.units
            if unit.identified and unit.recorded and results.has(unit.identified)
        ),
        None,
    )
    if identified:
        fit, data = (results.read(job) for job in identified)
        home = model.to_dict()["home"]
        out += [
            "<h2>What was identified, from what</h2>",
            _picture(
                lambda: figures.first_figure(fit, data, home),
                f"{html.escape(identified[0].name)}: ellipses have mass and inertia of their link,"
                " crosses are centres of mass; what torques cannot tell stays as it was. Right: the"
                " data.",
            ),
        ]
    errors = figures.length_error(rows, results)
    if errors is not None:
        out += [
            "<h2>Balls that leave their string</h2>",
            _picture(
                lambda: errors,
                "By how much the ball is further from the knot than it hung at first; median and"
                " 90 % of all policies.",
            ),
        ]
    return out


def _picture(draw: Callable[[], Figure], caption: str) -> str:
    data = base64.b64encode(figures.svg(draw()).encode()).decode()
    image = f'<img alt="" src="data:image/svg+xml;base64,{data}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"


def _keys() -> str:
    return "".join(
        f'<span class="key" style="background:{figures.COLORS[kind]}"></span>{TITLES[kind]}'
        for kind in KINDS
    )


def _cost(table: Json) -> list[str]:
    cost = table["cost"]
    lines = [
        f"<tr><td>{html.escape(kind)}</td><td>{found['jobs']}</td>"
        f"<td>{found['cpu_seconds']:.0f}</td>"
        f"<td>{found['cpu_seconds'] / found['jobs']:.1f}</td></tr>"
        for kind, found in cost["kinds"].items()
    ]
    full = cost["full"]
    without = (
        f", without {', '.join(full['not_measured'])}, which did not run"
        if full["not_measured"]
        else ""
    )
    runs = [
        f"<tr><td>{html.escape(run['executor'])}</td><td>{run['workers']}</td>"
        f"<td>{run['jobs']}</td><td>{run['seconds']:.0f}</td><td>{run['cpu_seconds']:.0f}</td>"
        f"<td>{percent(run['busy_share'])}</td></tr>"
        for run in cost["runs"]
    ]
    return [
        "<h2>What it took</h2>",
        "<table><thead><tr><th>jobs</th><th>number</th><th>processor seconds</th><th>each</th></tr>"
        f"</thead><tbody>{''.join(lines)}</tbody></table>",
        f"<p>{cost['cpu_hours']:.2f} processor hours. The paper's size (15 models, 150 policies"
        f" each, all lengths; {full['jobs']} jobs) takes {full['cpu_hours']:.1f} by these figures,"
        f" {full['hours_on_2_cores']:.1f} hours on 2 cores{html.escape(without)}.</p>",
        "<table><thead><tr><th>run on</th><th>workers</th><th>jobs</th><th>seconds</th>"
        f"<th>processor seconds</th><th>workers busy</th></tr></thead>"
        f"<tbody>{''.join(runs)}</tbody></table>"
        if runs
        else "",
    ]


def made_by(builds: Sequence[str]) -> str:
    """Return command, build and machine, as the end of a page."""
    command = shlex.join(["python", "-m", "diffnea.reproduce", *sys.argv[1:]])
    lines = [
        command,
        f"diffnea {_core.__version__}, build {', '.join(builds) or '–'}",
        f"{processor()}, {os.cpu_count()} cores, {platform.system()} {platform.release()},"
        f" Python {platform.python_version()}",
    ]
    return f"<h2>Made by</h2><pre>{html.escape(chr(10).join(lines))}</pre>"


def processor() -> str:
    """Name of the processor, where Linux says it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
