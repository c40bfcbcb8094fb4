"""Processes on all cores for trials."""

import multiprocessing
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress

from traction_evaluation.closed_loop.controllers import Controller
from traction_evaluation.closed_loop.trial import TrialDraw, run_trial
from traction_evaluation.closed_loop.trial_figures import Figures
from traction_evaluation.loop.shipped import SOIL, VEHICLE
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle

CHUNK = 4
"""Trials in one piece of work."""


class Outcome(NamedTuple):
    """Outcome of a trial: figures and step responses.

    Attributes
    ----------
    figures : Figures
        SI units.
    responses : ndarray, shape (2, k)
        Mean step responses, with sensor noise and without, dimensionless.
    """

    figures: Figures
    responses: NDArray[np.float64]


def run_draws(
    controller: Controller, draws: Sequence[TrialDraw], noise_free: bool = True
) -> list[Outcome]:
    """Run trials of a controller.

    Parameters
    ----------
    controller : Controller
        Controller in mode hold.
    draws : sequence of TrialDraw
        One per trial.
    noise_free : bool
        True to run each also without sensor noise.

    Returns
    -------
    list of Outcome
        Outcomes, in the order of the draws.
    """
    vehicle, soil = load_vehicle(VEHICLE), load_soil(SOIL)
    outcomes = []
    for draw in draws:
        driven = run_trial(
            draw,
            vehicle,
            soil,
            lambda draw: controller.loop(draw.pulses_per_turn),
            perfect=controller.perfect,
            noise_free=noise_free,
        )
        responses = np.array([driven.noisy_response, driven.noise_free_response])
        outcomes.append(Outcome(driven.figures, responses))
    return outcomes


def _one_thread() -> None:
    """Restrict this process to one thread."""
    for name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS'):
        os.environ[name] = '1'


class Workers:
    """Processes on all cores; a context manager.

    Parameters
    ----------
    console : Console
        Console for progress.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        # Before a process imports NumPy, since it inherits the environment.
        _one_thread()
        self._pool = ProcessPoolExecutor(
            len(os.sched_getaffinity(0)), mp_context=multiprocessing.get_context('spawn')
        )

    def __enter__(self) -> 'Workers':
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def map(
        self, text: str, function: Callable[..., Any], work: Sequence[Iterable[Any]]
    ) -> list[Any]:
        """Values of a function for many sets of arguments.

        Parameters
        ----------
        text : str
            Text of the progress.
        function : callable
            Function that can be pickled.
        work : sequence of iterable
            Arguments of every call.

        Returns
        -------
        list
            Values, in the order of `work`.
        """
        found = []
        with Progress(console=self._console, transient=True) as progress:
            task = progress.add_task(text, total=len(work))
            for value in self._pool.map(function, *zip(*work, strict=True)):
                found.append(value)
                progress.advance(task)
        return found

    def run(
        self,
        text: str,
        jobs: Sequence[tuple[Controller, Sequence[TrialDraw]]],
        noise_free: bool = True,
    ) -> dict[Controller, list[Outcome]]:
        """Run the trials of several controllers.

        Parameters
        ----------
        text : str
            Text of the progress.
        jobs : sequence of (Controller, sequence of TrialDraw)
            Each controller once, with its draws.
        noise_free : bool
            As for `run_draws`.

        Returns
        -------
        dict of Controller to list of Outcome
            Outcomes, in the order of the draws.
        """
        chunks = [
            (controller, draws[k : k + CHUNK])
            for controller, draws in jobs
            for k in range(0, len(draws), CHUNK)
        ]
        found = self.map(text, partial(run_draws, noise_free=noise_free), chunks)
        outcomes: dict[Controller, list[Outcome]] = {controller: [] for controller, _ in jobs}
        for (controller, _), part in zip(chunks, found, strict=True):
            outcomes[controller] += part
        return outcomes
