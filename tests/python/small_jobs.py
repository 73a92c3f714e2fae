"""Jobs that are quick, and one that kills its worker: importable where jobs run."""

import os
import signal
import time
from pathlib import Path

import numpy as np

from diffnea.reproduce.jobs import Json, Output, Result


def square(settings: Json, needs: list[Result]) -> Output:
    with Path(settings["log"]).open("a", encoding="utf-8") as file:
        file.write(f"{settings['x']}\n")
    return Output({"y": settings["x"] ** 2}, {"series": np.arange(3.0)})


def total(settings: Json, needs: list[Result]) -> Output:
    return Output({"sum": sum(need.data["y"] for need in needs)})


def sleep(settings: Json, needs: list[Result]) -> Output:
    time.sleep(settings["seconds"])
    return Output({"pid": os.getpid()})


def die(settings: Json, needs: list[Result]) -> Output:
    """Kill the process, ``times`` times: the file counts."""
    count = Path(settings["count"])
    before = len(count.read_text(encoding="utf-8")) if count.exists() else 0
    if before < settings["times"]:
        count.write_text("x" * (before + 1), encoding="utf-8")
        os.kill(os.getpid(), signal.SIGKILL)
    return Output({"survived": before})


def fail(settings: Json, needs: list[Result]) -> Output:
    raise ValueError("a mistake in the job")


def not_json(settings: Json, needs: list[Result]) -> Output:
    return Output({"y": object()}, {"series": np.arange(3.0)})
