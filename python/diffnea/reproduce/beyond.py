"""The step beyond the paper: diagnose what policies did, extend the model, learn again.

A unit is one robot, string and rope: recorded, identified, learned in and transferred; what its
policies did is seen by the robot's sensors and diagnosed; the extended model is learned in from
seeds that have not been used, once as it stands and once robustly, and transferred to the same
robot.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .._core import Error
from . import beyond_work, work
from .jobs import Job, Json
from .table1 import (
    check_search,
    check_worlds,
    identified_robot,
    label,
    robot_settings,
    world_settings,
)

ABOUT = "diagnose what learned policies did, extend the model, learn again: transfer before, after"

FIRST_SEED = 50_000
"""Of searches before; none of table1."""
LATER = 500
"""Seeds of searches after are so much above those before."""


@dataclass(frozen=True)
class Options:
    """Size of the study."""

    robots: int = 10
    """Drawn from the surrogate, numbers from ``first_robot``."""
    first_robot: int = 112
    """What was developed on is below."""
    seeds: int = 16
    """Policies of each robot, before and after."""
    lengths: tuple[float, ...] = (0.35, 0.40, 0.45)
    ropes: tuple[str, ...] = ("mid", "heavy")
    surrogate: str = "A"
    observed: int = 16
    """Policies whose recordings are diagnosed; every fourth is held out."""
    each: tuple[str, ...] = ()
    """Effects that also extend the model alone, for the gain of each."""
    robust: bool = True
    """Learn robustly as well: in draws that vary what was named."""
    arm_seconds: float = 40.0
    ball_seconds: float = 40.0
    ball_repetitions: int = 5
    search: Json = field(default_factory=dict)
    """Options of ``learn`` in place of its defaults."""

    def __post_init__(self) -> None:
        if self.robots < 1 or not 1 <= self.seeds <= LATER:
            raise Error(f"--robots, --seeds: expected 1 or more; of seeds {LATER} at most")
        if not self.observed >= 4:
            raise Error("--observed: expected 4 or more, of which every fourth is held out")
        if self.observed > self.seeds:
            raise Error(f"--observed: expected {self.seeds} at most, the policies of a robot")
        for effect in self.each:
            if effect not in beyond_work.STRING:
                raise Error(f"--each: got {effect!r}; choices: {', '.join(beyond_work.STRING)}")
        check_worlds(self.lengths, (self.surrogate,), self.ropes)
        check_search(self.search)


QUICK = Options(robots=2, seeds=12, observed=12, lengths=(0.40,), ropes=("mid",))


@dataclass(frozen=True)
class After:
    """Learned in an extended model."""

    effects: str
    """That could extend it: ``all``, or one."""
    robust: bool
    """Learned in draws of it."""
    diagnosed: Job
    learned: Job
    transfer: Job


@dataclass(frozen=True)
class Unit:
    """One robot, and its jobs."""

    robot: int
    identified: Job
    learned: Job
    before: Job
    observed: Job
    after: tuple[After, ...]


@dataclass(frozen=True)
class Row:
    """A line of the table: one string, one rope."""

    length: float
    rope: str
    units: tuple[Unit, ...]

    @property
    def title(self) -> str:
        """Where it is in the table."""
        return f"{100 * self.length:.0f} cm, {self.rope} rope"


@dataclass(frozen=True)
class Study:
    """Rows, and the jobs behind them."""

    options: Options
    rows: tuple[Row, ...]

    @property
    def jobs(self) -> list[Job]:
        """Of all rows."""
        return [
            job
            for row in self.rows
            for unit in row.units
            for job in (unit.before, *(after.transfer for after in unit.after))
        ]


def study(options: Options) -> Study:
    """Describe the whole of it; nothing is run."""
    rows = [
        Row(
            length,
            rope,
            tuple(
                _unit(options, length, rope, options.first_robot + k) for k in range(options.robots)
            ),
        )
        for rope in options.ropes
        for length in options.lengths
    ]
    return Study(options, tuple(rows))


def _unit(o: Options, length: float, rope: str, robot: int) -> Unit:
    settings: Json = robot_settings() | {"string": float(length)}
    world = world_settings(o.surrogate, rope, robot)
    name = f"{label(o.surrogate)}-{100 * length:g}cm-{rope}-r{robot}"
    _, identified = identified_robot(
        name,
        settings,
        world,
        seed=100 * robot,
        arm_seconds=o.arm_seconds,
        ball_seconds=o.ball_seconds,
        repetitions=o.ball_repetitions,
    )
    first = FIRST_SEED + 1000 * robot

    def searched(what: str, model: Job, begin: int, robust: bool = False) -> tuple[Job, Job]:
        learned = Job(
            f"learn-{what}-{name}",
            beyond_work.learn_robustly if robust else work.learn_policies,
            settings | {"seeds": list(range(begin, begin + o.seeds)), "search": o.search},
            needs=(model,),
            cost=1.2 * o.seeds,
        )
        return learned, Job(
            f"transfer-{what}-{name}",
            work.transfer_policies,
            settings | world | {"seed": robot},
            needs=(learned,),
            cost=1.5 * o.seeds,
        )

    learned, before = searched("before", identified, first)
    observed = Job(
        f"observe-{name}",
        beyond_work.observe,
        settings | world | {"seed": robot, "policies": o.observed},
        needs=(learned,),
        cost=1.5 * o.observed,
    )
    after = []
    for effects in ("all", *o.each):
        diagnosed = Job(
            f"diagnose-{effects}-{name}",
            beyond_work.diagnose_policies,
            {"effects": effects},
            needs=(identified, observed),
            cost=20.0,
        )
        after.append(
            After(
                effects, False, diagnosed, *searched(f"after-{effects}", diagnosed, first + LATER)
            )
        )
        if effects == "all" and o.robust:
            robust = searched("after-robust", diagnosed, first + LATER, robust=True)
            after.append(After(effects, True, diagnosed, *robust))
    return Unit(robot, identified, learned, before, observed, tuple(after))
