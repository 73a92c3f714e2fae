"""The paper's experiment: which models of the ball lead to movements that transfer.

Four kinds of models, one string in simulation, three on surrogates of the physical system. A unit
is one model of one kind and one world: recorded, identified or trained, learned in, transferred.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .. import models
from .._core import Error, _world_file
from . import work
from .jobs import Job, Json

ABOUT = "the paper's experiment: four kinds of models, in simulation and on surrogates"

ROBOT = "wam4_ball_in_cup"
KINDS = ("lstm", "ff-nn", "nominal", "diffnea")
TRAINED = ("lstm", "ff-nn")
TITLES = {"lstm": "LSTM", "ff-nn": "FF-NN", "nominal": "nominal", "diffnea": "DiffNEA"}
SIMULATION = "simulation"
FIRST_SEED = 1000
"""Of the searches; what the defaults of ``learn`` were chosen on is below 100.

As many are a model's own, those of the next one follow.
"""


OF_THE_STUDY = (
    *("model", "task", "controller", "string", "seeds", "progress"),
    *("rate", "ball_network", "reward", "ended"),
)
"""Options of ``learn``."""


@dataclass(frozen=True)
class Options:
    """Size of the study; the defaults are the paper's."""

    models: int = 15
    """Recordings, robots and initial guesses."""
    seeds: int = 150
    """Policies of each model."""
    lengths: tuple[float, ...] = (0.35, 0.40, 0.45)
    """Of the string [m], on the surrogates."""
    simulated_lengths: tuple[float, ...] = (0.40,)
    surrogates: tuple[str, ...] = ("A",)
    """Sizes of the perturbation, each a surrogate of the physical system."""
    kinds: tuple[str, ...] = KINDS
    trained_models: int | None = None
    """Of networks; None: as many as of the others."""
    rope: str = "mid"
    arm_seconds: float = 40.0
    ball_seconds: float = 40.0
    ball_repetitions: int = 5
    repetitions: int = 10
    chunk: int = 10
    """Policies a job."""
    search: Json = field(default_factory=dict)
    """Options of ``learn`` in place of its defaults."""
    training: Json = field(default_factory=dict)
    """Options of ``blackbox.train`` in place of its defaults."""

    def __post_init__(self) -> None:
        for kind in self.kinds:
            if kind not in KINDS:
                raise Error(f"--kinds: got {kind!r}; choices: {', '.join(KINDS)}")
        if self.models < 1 or self.seeds < 1:
            raise Error("--models, --seeds: expected 1 or more")
        if self.seeds > FIRST_SEED:
            raise Error(f"--seeds: got {self.seeds}, expected {FIRST_SEED} at most")
        if self.chunk < 1:
            raise Error(f"--chunk: got {self.chunk}, expected 1 or more")
        if self.trained_models is not None and not 0 <= self.trained_models <= self.models:
            raise Error(f"--trained-models: expected 0 to {self.models}, the number of models")
        check_worlds((*self.lengths, *self.simulated_lengths), self.surrogates, (self.rope,))
        check_search(self.search)


def check_worlds(lengths: Sequence[float], surrogates: Sequence[str], ropes: Sequence[str]) -> None:
    """Refuse now what a job would only refuse when it runs."""
    for length in lengths:
        if not 0 < length < math.inf:
            raise Error(f"--lengths: got {length:g} m, expected above 0")
    for surrogate in ("none", *surrogates):
        for rope in ropes:
            _world_file(f"mujoco:{ROBOT},perturb={surrogate},rope={rope}")


def check_search(options: Iterable[str]) -> None:
    """Refuse options of ``learn`` that the study sets itself."""
    for option in options:
        if option in OF_THE_STUDY:
            raise Error(
                f"--search {option}: is the study's own and cannot be given; leave it out"
                + (f" (traces are of {1 / work.STEP:g} Hz)" if option == "rate" else "")
            )


QUICK = Options(models=2, seeds=10, lengths=(0.40,), trained_models=1)


@dataclass(frozen=True)
class Unit:
    """One model of one kind, and its jobs."""

    number: int
    transfers: tuple[Job, ...]
    learned: tuple[Job, ...]
    repeat: Job
    identified: Job | None = None
    recorded: Job | None = None
    trained: Job | None = None

    @property
    def jobs(self) -> tuple[Job, ...]:
        """All of them."""
        own = (self.identified, self.recorded, self.trained)
        return (self.repeat, *self.transfers, *self.learned, *(job for job in own if job))


@dataclass(frozen=True)
class Row:
    """A line of the table: one kind of model, one length, one system."""

    system: str
    """``simulation``, or a surrogate's name."""
    length: float
    kind: str
    units: tuple[Unit, ...]
    not_run: str = ""
    """Why there are no units."""

    @property
    def title(self) -> str:
        """Where it is in the table."""
        system = self.system if self.system == SIMULATION else f"surrogate {self.system}"
        return f"{system}, {100 * self.length:.0f} cm, {TITLES[self.kind]}"


@dataclass(frozen=True)
class Study:
    """Rows, and the jobs behind them."""

    options: Options
    rows: tuple[Row, ...]

    @property
    def jobs(self) -> list[Job]:
        """Of all rows."""
        return [job for row in self.rows for unit in row.units for job in unit.jobs]


def study(options: Options) -> Study:
    """Describe the whole of it; nothing is run."""
    build = _Builder(options)
    rows = [row for length in options.simulated_lengths for row in build.rows(SIMULATION, length)]
    for surrogate in options.surrogates:
        for length in options.lengths:
            rows += build.rows(surrogate, length)
    return Study(options, tuple(rows))


def robot_settings() -> Json:
    """Return what every job of the robot depends on: its description, by name and content."""
    file = Path(models.path(f"{ROBOT}.xml"))
    return {
        "model": ROBOT,
        "description": _checksum(file),
    }


def world_settings(surrogate: str, rope: str, seed: int | None = None) -> Json:
    """Return what jobs in a world depend on: its name, and the ranges where they are a file."""
    drawn = "" if seed is None else f",seed={seed}"
    out: Json = {"world": f"mujoco:{ROBOT},perturb={surrogate},rope={rope}{drawn}"}
    return out | ({"ranges": _checksum(Path(surrogate))} if _is_file(surrogate) else {})


def label(system: str) -> str:
    """Name a system in jobs' names, which are names of files; not those of the same stem alike."""
    if not _is_file(system):
        return system
    file = Path(system)
    return f"{re.sub(r'[^A-Za-z0-9_.-]', '_', file.stem)}-{_checksum(file)[:6]}"


def _is_file(surrogate: str) -> bool:
    return surrogate.endswith(".json")  # the library's own are names without an ending


def _checksum(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()[:12]


def identified_robot(
    name: str,
    settings: Json,
    world: Json,
    *,
    seed: int,
    arm_seconds: float,
    ball_seconds: float,
    repetitions: int,
    guess: int | None = None,
) -> tuple[Job, Job]:
    """Record a robot in a world, and identify it; guess: from a wrong one."""
    recorded = Job(
        f"record-{name}",
        work.record,
        settings
        | world
        | {
            "seed": seed,
            "arm_seconds": float(arm_seconds),
            "ball_seconds": float(ball_seconds),
            "repetitions": repetitions,
        },
        cost=10.0 + 0.35 * ball_seconds * repetitions,
    )
    identified = Job(
        f"identify-{name}",
        work.identify,
        settings if guess is None else settings | {"guess": guess},
        needs=(recorded,),
        cost=5.0,
    )
    return recorded, identified


class _Builder:
    """Makes jobs; those of nominal policies serve every system."""

    def __init__(self, options: Options) -> None:
        self.options = options
        self.robot = robot_settings()

    def rows(self, system: str, length: float) -> list[Row]:
        """One a kind; networks are given what the white-box models did."""
        white = {kind: self._white(system, length, kind) for kind in ("nominal", "diffnea")}
        return [
            self._trained(system, length, kind, white) if kind in TRAINED else white[kind]
            for kind in self.options.kinds
        ]

    def _white(self, system: str, length: float, kind: str) -> Row:
        units = []
        for number in range(self.options.models):
            settings = self._settings(length)
            recorded = identified = None
            if kind == "diffnea":
                recorded, identified = self._identified(system, length, number)
            learned = []
            for first, seeds in self._chunks(number):
                name = f"{_cm(length)}-{kind}-m{number:02d}-s{first:03d}"
                if identified:
                    name = f"{label(system)}-{name}"
                learned.append(
                    Job(
                        f"learn-{name}",
                        work.learn_policies,
                        settings | {"seeds": seeds, "search": self.options.search},
                        needs=(identified,) if identified else (),
                        cost=1.0 * len(seeds),
                    )
                )
            units.append(
                self._transferred(system, length, kind, number, learned, identified, recorded)
            )
        return Row(system, length, kind, tuple(units))

    def _trained(self, system: str, length: float, kind: str, white: dict[str, Row]) -> Row:
        if missing := work.missing_for_networks():
            return Row(system, length, kind, (), missing)
        o, settings, units = self.options, self._settings(length), []
        for number in range(o.models if o.trained_models is None else o.trained_models):
            name = f"{label(system)}-{_cm(length)}-{kind}-m{number:02d}"
            unit = white["diffnea"].units[number]
            assert unit.identified
            assert unit.recorded
            executed = (*unit.transfers, *white["nominal"].units[number].transfers)
            trained = Job(
                f"train-{name}",
                work.train_network,
                settings | {"kind": kind, "seed": number, "training": o.training},
                needs=(unit.identified, unit.recorded, *executed),
                cost=150.0,
            )
            learned = [
                Job(
                    f"learn-{name}-s{first:03d}",
                    work.learn_in_network,
                    settings | {"seeds": seeds, "search": o.search},
                    needs=(trained, unit.identified),
                    cost=3.0 * len(seeds),
                )
                for first, seeds in self._chunks(number)
            ]
            units.append(
                self._transferred(
                    system, length, kind, number, learned, unit.identified, unit.recorded, trained
                )
            )
        return Row(system, length, kind, tuple(units))

    def _identified(self, system: str, length: float, number: int) -> tuple[Job, Job]:
        o, world = self.options, self._world(system, number)
        simulated = system == SIMULATION
        if simulated:
            world["world"] += ",noise=0"
        return identified_robot(
            f"{label(system)}-{_cm(length)}-m{number:02d}",
            self._settings(length),
            world,
            seed=100 * (number + 1),
            arm_seconds=o.arm_seconds,
            ball_seconds=o.ball_seconds,
            # Without noise all repetitions are the same.
            repetitions=1 if simulated else o.ball_repetitions,
            guess=number + 1 if simulated else None,
        )

    def _transferred(
        self,
        system: str,
        length: float,
        kind: str,
        number: int,
        learned: Sequence[Job],
        identified: Job | None = None,
        recorded: Job | None = None,
        trained: Job | None = None,
    ) -> Unit:
        settings = self._settings(length) | self._world(system, number) | {"seed": number + 1}
        name = f"{label(system)}-{_cm(length)}-{kind}-m{number:02d}"
        transfers = tuple(
            Job(
                f"transfer-{name}-{job.name.rsplit('-', 1)[1]}",
                work.transfer_policies,
                settings,
                needs=(job,),
                cost=0.7 * len(job.settings["seeds"]),
            )
            for job in learned
        )
        repeat = Job(
            f"repeat-{name}",
            work.repeat_best,
            settings | {"repetitions": self.options.repetitions},
            needs=(*learned, *transfers),
            cost=0.7 * self.options.repetitions,
        )
        return Unit(number, transfers, tuple(learned), repeat, identified, recorded, trained)

    def _settings(self, length: float) -> Json:
        return self.robot | {"string": float(length)}

    def _world(self, system: str, number: int) -> Json:
        if system == SIMULATION:
            return world_settings("none", self.options.rope)
        return world_settings(system, self.options.rope, number + 1)

    def _chunks(self, number: int) -> list[tuple[int, list[int]]]:
        """Of one model's seeds, which no other model has."""
        o = self.options
        first = FIRST_SEED * (number + 1)
        return [
            (k, list(range(first + k, first + min(k + o.chunk, o.seeds))))
            for k in range(0, o.seeds, o.chunk)
        ]


def _cm(length: float) -> str:
    return f"{100 * length:g}cm"
