"""Execution of sweeps on all cores or on a Dask cluster, with results as Parquet."""

import importlib.metadata
import json
import math
import multiprocessing
import os
import platform
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.stats import spearmanr

from traction_model.simulation.sweep import FIGURES, Row, Sweep, SweepDraw, simulate_draws

SAVE_EVERY = 30.0
"""Period of saving finished rows, s."""

MAX_DRAWS = 8
"""Largest number of draws in one piece of work."""

REACH_TIMEOUT = 10.0
"""Timeout of the connection to a Dask scheduler, s."""

ROW_GROUP = 10_000
# Packages whose versions affect the result.
_VERSIONS = ('traction_model', 'numpy', 'scipy', 'numba', 'pyarrow')


@dataclass(frozen=True)
class SweepResult:
    """Result of a sweep.

    Attributes
    ----------
    table : pyarrow.Table
        One row per finished draw, in order; units in the metadata of the fields.
    asked : int
        Number of draws requested.
    interrupted : bool
        True if the user stopped it.
    """

    table: pa.Table
    asked: int
    interrupted: bool

    @property
    def failed(self) -> int:
        """Number of finished draws whose simulation failed."""
        return len(self.table) - len(self.succeeded)

    @property
    def succeeded(self) -> pa.Table:
        """Rows of the draws without failure."""
        return self.table.filter(pc.equal(self.table['error'], ''))

    @property
    def parameters(self) -> list[str]:
        """Names of the varied quantities, in the order of the definition."""
        names: list[str] = self.table.column_names
        return names[1 : names.index(next(iter(FIGURES)))]


def schema(sweep: Sweep) -> pa.Schema:
    """Schema of the results of a sweep.

    Parameters
    ----------
    sweep : Sweep
        The sweep.

    Returns
    -------
    pyarrow.Schema
        Fields have ``unit`` (and ``meaning``) as metadata; the schema has definition, nominal
        drive and versions in JSON.
    """
    fields = [pa.field('draw', pa.int64(), nullable=False)]
    for quantity, distribution in sweep.varied.items():
        words = bool(not quantity.unit and distribution.choice)
        fields.append(_field(quantity.name, pa.string() if words else pa.float64(), quantity.unit))
    for name, figure in FIGURES.items():
        kind = pa.float64() if figure.unit else pa.bool_()
        fields.append(_field(name, kind, figure.unit, figure.meaning))
    fields.append(_field('error', pa.string(), '', 'why the draw failed; empty where it did not'))
    versions = {name: importlib.metadata.version(name) for name in _VERSIONS}
    return pa.schema(
        fields,
        metadata={
            'definition': sweep.definition.model_dump_json(),
            'nominal': sweep.nominal.model_dump_json(),
            'versions': json.dumps({'python': platform.python_version(), **versions}),
        },
    )


def _field(name: str, kind: pa.DataType, unit: str, meaning: str = '') -> pa.Field:
    told = {'unit': unit, 'meaning': meaning}
    return pa.field(name, kind, metadata={key: text for key, text in told.items() if text})


def run_sweep(
    sweep: Sweep,
    path: Path | str,
    *,
    workers: int | None = None,
    scheduler: str = '',
    progress: Callable[[int, int], None] | None = None,
) -> SweepResult:
    """Simulate all draws of a sweep and write finished ones to a file.

    The file does not depend on the number of workers. Ctrl-C ends the sweep. Finished draws are in
    the file in any case.

    Parameters
    ----------
    sweep : Sweep
        The sweep.
    path : Path or str
        Parquet file to write.
    workers : int, optional
        Number of processes on this machine, at least 1; default: one per core.
    scheduler : str
        Address of a Dask scheduler, such as ``tcp://host:8786``, whose workers to use instead.
    progress : callable, optional
        Called with the numbers of finished and failed draws.

    Returns
    -------
    SweepResult
        Finished draws.

    Raises
    ------
    ValueError
        If `workers` is below 1, or given together with `scheduler`.
    RuntimeError
        If dask is not installed, the scheduler does not respond or has no workers, or workers die.
    OSError
        If the file cannot be written.
    """
    if workers is not None and scheduler:
        raise ValueError('workers: the cluster has its own; give workers or scheduler')
    if workers is not None and workers < 1:
        raise ValueError(f'workers must be at least 1, got {workers}')
    draws = sweep.draws()
    store = _Store(schema(sweep), Path(path), progress)
    # Before any work, so that an unwritable folder is an error at once.
    store.save()
    interrupted = False
    try:
        if scheduler:
            _on_cluster(sweep, draws, scheduler, store.add)
        else:
            _on_cores(sweep, draws, workers or _cores(), store.add)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        with _interrupts_ignored():
            table = store.save()
    return SweepResult(table, len(draws), interrupted)


class _Store:
    """Finished rows, saved periodically."""

    def __init__(
        self, schema: pa.Schema, path: Path, progress: Callable[[int, int], None] | None
    ) -> None:
        self.schema = schema
        self.path = path
        self.progress = progress
        # Rows by index of their first draw.
        self.batches: dict[int, pa.RecordBatch] = {}
        self.finished = self.failed = 0
        self.saved = time.monotonic()

    def add(self, rows: list[Row]) -> None:
        """Add the rows of one piece of work, unless they exist."""
        first = rows[0]['draw']
        if first in self.batches:
            return
        self.batches[first] = pa.RecordBatch.from_pylist(rows, schema=self.schema)
        self.finished += len(rows)
        self.failed += sum(row['error'] != '' for row in rows)
        if time.monotonic() - self.saved > SAVE_EVERY:
            self.save()
        if self.progress is not None:
            self.progress(self.finished, self.failed)

    def save(self) -> pa.Table:
        """Write all rows in the order of the draws, independent of the order of work."""
        batches = [self.batches[first] for first in sorted(self.batches)]
        table = pa.Table.from_batches(batches, self.schema).combine_chunks()
        unfinished = self.path.with_name(f'.{self.path.name}.part')
        pq.write_table(table, unfinished, row_group_size=ROW_GROUP)
        unfinished.replace(self.path)
        self.saved = time.monotonic()
        return table


def _cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0))


def _chunks(draws: Sequence[SweepDraw], workers: int) -> list[Sequence[SweepDraw]]:
    """Pieces of work, small enough that no worker waits long at the end."""
    size = max(1, min(MAX_DRAWS, math.ceil(len(draws) / (8 * workers))))
    return [draws[k : k + size] for k in range(0, len(draws), size)]


def _on_cores(
    sweep: Sweep, draws: Sequence[SweepDraw], workers: int, add: Callable[[list[Row]], None]
) -> None:
    """Simulate in processes on this machine."""
    # Spawned, since a fork would copy locks held by threads of this process.
    executor = ProcessPoolExecutor(
        min(workers, len(draws)), mp_context=multiprocessing.get_context('spawn')
    )
    others = set(multiprocessing.active_children())
    # Processes started meanwhile ignore Ctrl-C; this process ends them.
    with _interrupts_ignored():
        pending = [
            executor.submit(simulate_draws, sweep, part) for part in _chunks(draws, workers)
        ]
        ours = set(multiprocessing.active_children()) - others
    try:
        for future in as_completed(pending):
            add(future.result())
    except BrokenProcessPool as error:
        raise RuntimeError(
            'a worker process died (out of memory?); what was finished is kept'
        ) from error
    finally:
        with _interrupts_ignored():
            if not all(future.done() for future in pending):
                # Interrupted: a worker may be in a long piece of work.
                executor.shutdown(wait=False, cancel_futures=True)
                for process in ours:
                    process.terminate()
                for process in ours:
                    process.join()
            executor.shutdown()
            for future in pending:
                if future.done() and not future.cancelled() and future.exception() is None:
                    add(future.result())


@contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """Ignore Ctrl-C in this block, if this is the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _on_cluster(
    sweep: Sweep, draws: Sequence[SweepDraw], url: str, add: Callable[[list[Row]], None]
) -> None:
    """Simulate on the workers of a Dask cluster."""
    try:
        import distributed
    except ImportError as error:
        raise RuntimeError(
            f'{error.name} is not installed: pip install dask distributed'
        ) from error
    try:
        client = distributed.Client(url, timeout=REACH_TIMEOUT)
    except (OSError, ValueError) as error:
        raise RuntimeError(f'no Dask scheduler answers at {url}: {error}') from error
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise RuntimeError(f'the Dask scheduler at {url} has no workers: start some first')
        pending = [
            client.submit(simulate_draws, sweep, part, pure=False)
            for part in _chunks(draws, threads)
        ]
        try:
            for future in distributed.as_completed(pending):
                add(_fetched(future, url))
        except KeyboardInterrupt:
            with _interrupts_ignored():
                for future in pending:
                    if future.status == 'finished':
                        add(_fetched(future, url))
            raise
        finally:
            with suppress(OSError):
                client.cancel(pending)


def _fetched(future: Any, url: str) -> list[Row]:
    """Rows of a finished piece of work from a cluster; errors there have a clear text."""
    from distributed import KilledWorker

    try:
        rows: list[Row] = future.result()
    except ModuleNotFoundError as error:
        raise RuntimeError(
            f'the workers of {url} lack {error.name}: install traction_model on them'
        ) from error
    except KilledWorker as error:
        raise RuntimeError(f'workers of {url} died: {error}') from error
    except (OSError, CancelledError) as error:
        raise RuntimeError(f'the scheduler {url} went away; what was finished is kept') from error
    return rows


def rank_correlations(result: SweepResult, figure: str) -> dict[str, float]:
    """Spearman's rank correlation of a figure with each varied quantity.

    Parameters
    ----------
    result : SweepResult
        Result of a sweep.
    figure : str
        One of `traction_model.simulation.sweep.FIGURES`.

    Returns
    -------
    dict of str to float
        -1 to 1 for every varied number, the strongest first; NaN if it is constant or there are
        fewer than three draws.
    """
    table = result.succeeded
    values = numbers(table, figure)
    found = {}
    for name in result.parameters:
        if pa.types.is_floating(table.schema.field(name).type):
            drawn = numbers(table, name)
            both = np.isfinite(drawn) & np.isfinite(values)
            varies = both.sum() > 2 and np.ptp(drawn[both]) > 0 and np.ptp(values[both]) > 0
            rho = spearmanr(drawn[both], values[both]).statistic if varies else math.nan
            found[name] = float(rho)
    return dict(sorted(found.items(), key=lambda item: -abs(np.nan_to_num(item[1]))))


def numbers(table: pa.Table, column: str) -> NDArray[np.float64]:
    """Column as floats.

    Parameters
    ----------
    table : pyarrow.Table
        Results.
    column : str
        Name of a column of numbers.

    Returns
    -------
    ndarray, shape (k,)
        Values in the unit of the column; NaN for missing ones.
    """
    return np.asarray(table[column].cast(pa.float64()).to_numpy(zero_copy_only=False))
