"""Sweeps as run: the same file from any workers, nothing lost, units, picture, command."""

import json
import multiprocessing
import os
import signal
import sys
from concurrent.futures import wait

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from distributed import LocalCluster
from PIL import Image
from typer.testing import CliRunner

from traction_bringup import command
from traction_evaluation.drives.picture import DPI, FigureDistribution, draw_sweep
from traction_evaluation.sweeps import sweep
from traction_evaluation.sweeps.sweep import SweepResult, rank_correlations, run_sweep
from traction_evaluation.sweeps.sweep_report import distributions
from traction_model.simulation.sweep import FIGURES, read_sweep, simulate_draws
from traction_node.parameter_file import config

DRAWS = 12


@pytest.fixture(scope='module')
def definition(tmp_path_factory):
    """A sweep whose draws take some milliseconds; those of a heavy clay that is drawn differ."""
    path = tmp_path_factory.mktemp('definition') / 'quick.yaml'
    path.write_text(
        yaml.safe_dump(
            {
                'vehicle': 'single_wheel_rig',
                'soil': 'sandy_loam_15',
                'drawbar': {'pull': 500},
                'torque': {'constant': 700},
                'duration': 0.5,
                'settle': 0.25,
                'initial_speed': 1.0,
                'draws': DRAWS,
                'vary': {
                    'soil': {'choice': ['sandy_loam_15', 'dry_sand']},
                    'soil.cohesion': {'relative': 0.5},
                    'torque': {'uniform': [0.8, 1.2]},
                },
            }
        )
    )
    return path


@pytest.fixture(scope='module')
def read(definition):
    return read_sweep(definition)


def workers():
    """Processes of a sweep that run now; those of the cluster are daemons."""
    return [process for process in multiprocessing.active_children() if not process.daemon]


@pytest.fixture(scope='module')
def expected(read):
    """Results computed in this process."""
    return simulate_draws(read, read.draws())


@pytest.fixture(scope='module')
def on_two_cores(read, tmp_path_factory):
    path = tmp_path_factory.mktemp('two') / 'sweep.parquet'
    calls = []

    def progress(finished, failed):
        if not calls:
            # A Ctrl-C reaches the whole group of processes: workers leave it to their parent.
            for process in workers():
                os.kill(process.pid, signal.SIGINT)
        calls.append((finished, failed))

    result = run_sweep(read, path, workers=2, progress=progress)
    assert [finished for finished, _ in calls] == sorted(finished for finished, _ in calls)
    assert calls[-1] == (DRAWS, 0)
    return path, result


@pytest.fixture(scope='module')
def cluster():
    with LocalCluster(
        n_workers=2, threads_per_worker=1, host='127.0.0.1', dashboard_address='127.0.0.1:0'
    ) as running:
        yield running


def test_rows_are_those_of_the_core(on_two_cores, expected):
    path, result = on_two_cores
    assert pq.read_table(path).to_pylist() == expected
    assert result.table.to_pylist() == expected
    assert not result.interrupted
    assert result.failed == 0
    assert workers() == []


def test_one_worker_writes_the_same_file_and_saves_it_now_and_then(
    read, on_two_cores, tmp_path, monkeypatch
):
    monkeypatch.setattr(sweep, 'SAVE_EVERY', 0.0)
    path = tmp_path / 'sweep.parquet'
    saved = []
    run_sweep(
        read,
        path,
        workers=1,
        progress=lambda finished, failed: saved.append((finished, len(pq.read_table(path)))),
    )
    assert len(saved) > 1
    assert all(finished == rows for finished, rows in saved)
    assert path.read_bytes() == on_two_cores[0].read_bytes()
    assert [file.name for file in tmp_path.iterdir()] == ['sweep.parquet']


def test_a_dask_cluster_writes_the_same_file(read, on_two_cores, tmp_path, cluster):
    run_sweep(read, tmp_path / 'dask.parquet', scheduler=cluster.scheduler_address)
    assert (tmp_path / 'dask.parquet').read_bytes() == on_two_cores[0].read_bytes()


def test_the_file_tells_units_and_where_it_comes_from(on_two_cores, read):
    schema = pq.read_schema(on_two_cores[0])
    units = {
        field.name: field.metadata[b'unit'].decode()
        for field in schema
        if field.metadata and b'unit' in field.metadata
    }
    assert units == {
        'soil.cohesion': 'Pa',
        'torque': '1',
        **{name: figure.unit for name, figure in FIGURES.items() if figure.unit},
    }
    # All numbers have one.
    floats = {field.name for field in schema if pa.types.is_floating(field.type)}
    assert floats == set(units)
    assert schema.names[:4] == ['draw', 'soil', 'soil.cohesion', 'torque']
    assert schema.field('soil').type == pa.string()
    assert schema.field('immobilised').type == pa.bool_()
    told = {key: json.loads(schema.metadata[key]) for key in (b'definition', b'nominal')}
    assert told[b'definition'] == read.definition.model_dump(mode='json')
    assert told[b'nominal']['soil'][0]['cohesion'] == read.nominal.soil[0].cohesion
    versions = json.loads(schema.metadata[b'versions'])
    assert versions['pyarrow'] == pa.__version__
    assert {'python', 'traction_model', 'numba', 'numpy', 'scipy'} < set(versions)


def test_an_interruption_keeps_what_is_finished(read, expected, tmp_path):
    def interrupt(finished, failed):
        os.kill(os.getpid(), signal.SIGINT)

    path = tmp_path / 'sweep.parquet'
    result = run_sweep(read, path, workers=1, progress=interrupt)
    assert result.interrupted
    assert result.asked == DRAWS
    kept = pq.read_table(path).to_pylist()
    assert 0 < len(kept) < DRAWS
    assert kept == [expected[row['draw']] for row in kept]
    assert workers() == []


def test_an_interruption_keeps_what_is_finished_but_not_yet_taken(
    read, expected, tmp_path, monkeypatch
):
    def late(pending):
        wait(pending)
        yield pending[0]
        raise KeyboardInterrupt

    monkeypatch.setattr(sweep, 'as_completed', late)
    result = run_sweep(read, tmp_path / 'sweep.parquet', workers=1)
    assert result.interrupted
    assert pq.read_table(tmp_path / 'sweep.parquet').to_pylist() == expected


def test_a_worker_that_dies_is_told_and_what_is_finished_is_kept(read, expected, tmp_path):
    def kill(finished, failed):
        for process in workers():
            process.kill()

    path = tmp_path / 'sweep.parquet'
    with pytest.raises(RuntimeError, match='a worker process died'):
        run_sweep(read, path, workers=1, progress=kill)
    kept = pq.read_table(path).to_pylist()
    assert kept
    assert kept == [expected[row['draw']] for row in kept]


def test_workers_that_make_no_sense_are_refused(read, tmp_path):
    with pytest.raises(ValueError, match='workers must be at least 1, got 0'):
        run_sweep(read, tmp_path / 'x.parquet', workers=0)
    with pytest.raises(ValueError, match='give workers or scheduler'):
        run_sweep(read, tmp_path / 'x.parquet', workers=1, scheduler='tcp://127.0.0.1:1')


def test_a_folder_that_is_not_there_is_told_before_any_work(read, tmp_path):
    with pytest.raises(FileNotFoundError, match='nowhere'):
        run_sweep(read, tmp_path / 'nowhere' / 'x.parquet', progress=pytest.fail)


def test_a_scheduler_that_does_not_answer_is_named(read, tmp_path, monkeypatch):
    monkeypatch.setattr(sweep, 'REACH_TIMEOUT', 0.5)
    # Port 1 of this machine: no listener.
    with pytest.raises(RuntimeError, match=r'no Dask scheduler answers at tcp://127\.0\.0\.1:1: '):
        run_sweep(read, tmp_path / 'x.parquet', scheduler='tcp://127.0.0.1:1')


def test_a_scheduler_without_workers_is_told(read, tmp_path):
    with (
        LocalCluster(
            n_workers=0,
            processes=False,
            protocol='tcp',
            host='127.0.0.1',
            dashboard_address='127.0.0.1:0',
        ) as empty,
        pytest.raises(RuntimeError, match='has no workers'),
    ):
        run_sweep(read, tmp_path / 'x.parquet', scheduler=empty.scheduler_address)


def test_a_scheduler_that_goes_away_is_told_and_what_is_finished_is_kept(read, expected, tmp_path):
    path = tmp_path / 'sweep.parquet'
    with LocalCluster(
        n_workers=1, threads_per_worker=1, host='127.0.0.1', dashboard_address='127.0.0.1:0'
    ) as leaving:
        address = leaving.scheduler_address
        with pytest.raises(RuntimeError, match=f'scheduler {address} went away'):
            run_sweep(
                read,
                path,
                scheduler=address,
                progress=lambda finished, failed: leaving.close(),
            )
    kept = pq.read_table(path).to_pylist()
    assert 0 < len(kept) < DRAWS
    assert kept == [expected[row['draw']] for row in kept]


def test_dask_that_is_not_installed_is_told(read, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'distributed', None)
    with pytest.raises(RuntimeError, match='distributed is not installed: pip install dask'):
        run_sweep(read, tmp_path / 'x.parquet', scheduler='tcp://127.0.0.1:1')


def result_of(columns):
    """A result with these columns of numbers, the figures that are missing being 0."""
    count = len(next(iter(columns.values())))
    figures = {name: columns.get(name, [0.0] * count) for name in FIGURES}
    table = pa.table({'draw': range(count), **columns, **figures, 'error': [''] * count})
    return SweepResult(table, count, False)


def test_rank_correlations_by_hand():
    # Spearman: 1 - 6·sum(d²)/(k(k² - 1)) with the differences d of ranks. For 1 2 3 4 against
    # 1 3 2 4 the sum is 2: 1 - 12/60 = 0.8. The figure rises with `up`, however it is bent.
    result = result_of(
        {
            'some': [1.0, 3.0, 2.0, 4.0],
            'down': [4.0, 3.0, 2.0, 1.0],
            'up': [1.0, 10.0, 100.0, 1000.0],
            'still': [5.0, 5.0, 5.0, 5.0],
        }
        | {'slip_mean': [0.1, 0.2, 0.3, 0.4]}
    )
    found = rank_correlations(result, 'slip_mean')
    assert np.isnan(found.pop('still'))
    assert found == pytest.approx({'down': -1.0, 'up': 1.0, 'some': 0.8})
    assert list(found)[-1] == 'some'


def test_a_draw_without_a_figure_does_not_count_for_it():
    result = result_of({'up': [1.0, 2.0, 3.0, 0.0], 'slip_mean': [0.1, 0.2, 0.3, None]})
    assert rank_correlations(result, 'slip_mean')['up'] == pytest.approx(1.0)


def test_pictures_have_the_size_of_their_columns_and_bars(on_two_cores, tmp_path):
    draw_sweep(distributions(on_two_cores[1]), 'quick', tmp_path / 'two.png')
    values = np.array([np.nan, np.nan])
    many = [FigureDistribution('slip', values, {f'parameter {k}': 0.1 * k for k in range(7)})]
    draw_sweep(many, 'none', tmp_path / 'seven.png')
    with Image.open(tmp_path / 'two.png') as two, Image.open(tmp_path / 'seven.png') as seven:
        # Three columns of 4.2 in against one; five bars of 0.32 in more.
        assert two.width - seven.width == pytest.approx(2 * 4.2 * DPI, abs=1)
        assert seven.height - two.height == pytest.approx(5 * 0.32 * DPI, abs=1)
        assert two.width == pytest.approx(15.0 * DPI, abs=1)


def run_command(*arguments):
    return CliRunner().invoke(command.app, ['sweep', *map(str, arguments)])


def test_the_command_leaves_results_and_a_picture_and_counts_failures(definition, tmp_path):
    content = yaml.safe_load(definition.read_text()) | {
        'vehicle': 'tractor_4wd',
        'sampling': 'sobol',
        # Behind the rear axle it lifts the front wheels.
        'vary': {'vehicle.chassis_cg_x': {'choice': [0.9, -2.0]}},
    }
    path = tmp_path / 'lifted.yaml'
    path.write_text(yaml.safe_dump(content))
    done = run_command(path, '--workers', 1, '--draws', 4, '--output', tmp_path / 'out')
    assert done.exit_code == 0, done.output
    assert '4 of 4 draws, 2 failed' in done.output
    assert '2 of 4 draws failed' in done.output
    assert '2 times: vehicle: the centre of gravity lifts a wheel at rest' in done.output
    assert 'tractive_efficiency' in done.output
    [folder] = (tmp_path / 'out').iterdir()
    assert folder.name.startswith('lifted_')
    assert sorted(path.name for path in folder.iterdir()) == ['sweep.parquet', 'sweep.png']
    read = read_sweep(path, draws=4)
    rows = pq.read_table(folder / 'sweep.parquet').to_pylist()
    assert rows == simulate_draws(read, read.draws())


def test_the_command_ends_with_the_status_of_an_interruption(
    definition, on_two_cores, tmp_path, monkeypatch
):
    table = on_two_cores[1].table.slice(0, 5)
    monkeypatch.setattr(
        'traction_evaluation.sweeps.sweep_report.run_sweep',
        lambda *args, **kwargs: SweepResult(table, DRAWS, True),
    )
    done = run_command(definition, '--output', tmp_path)
    assert done.exit_code == 130
    assert f'interrupted: 5 of {DRAWS} draws are finished' in done.output
    assert 'tractive_efficiency' in done.output


@pytest.mark.parametrize(
    ('name', 'message'),
    [
        (
            'sweep_tracto',
            "no such file, nor a sweep that is shipped; did you mean 'sweep_tractor'",
        ),
        ('none.yaml', 'none.yaml: No such file or directory'),
    ],
)
def test_a_definition_that_is_not_there_is_one_line(name, message, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(sys, 'argv', ['traction', 'sweep', name, '-o', str(tmp_path / 'out')])
    assert command.main() == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


def test_the_shipped_sweep_is_valid():
    shipped = read_sweep(config('traction_evaluation', 'sweep_tractor.yaml'), draws=4)
    rows = simulate_draws(shipped, shipped.draws()[:1])
    assert rows[0]['error'] == ''
    assert 0.0 < rows[0]['slip_mean'] < 1.0
