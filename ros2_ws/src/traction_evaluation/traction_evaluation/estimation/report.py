"""Sections of the report on estimation: bags, changes of soil, field data, time of a step."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from traction_evaluation.estimation import field_data
from traction_evaluation.estimation.estimate_errors import estimate_errors, replay_with_radar
from traction_evaluation.markdown import Target, fill, table, target_table
from traction_evaluation.verification.chrono import CHRONO_RUNS, SAMPLE_TIME, read_chrono
from traction_evaluation.verification.chrono_bags import RADAR_SIGMA, SEEDS
from traction_model.contact.tractive import static_contact_length
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle
from traction_node.stamp import nanoseconds

METHODS = ('ukf', 'ekf', 'scheduled_gain')
# Straight ahead with smooth torque, and not at up to 56 m/s as two others.
TRACTOR_SPEED = (
    'wheel_drawbar', 'wheel_torque_sine', 'wheel_soft_patch', 'tractor_sandy_loam',
    'tractor_soft_patch',
)  # fmt: skip
SOFT_PATCH = ('wheel_soft_patch', 'tractor_soft_patch')
RENOISED = range(100, 104)
GAP = 5.0
RADAR_EVERY = 20
"""Samples between two radar readings of the bags."""

# Targets.
SLIP_RMSE = 0.01
WITHIN = (0.90, 0.99)
GAP_COSTS = 0.03
STRENGTH_WITHIN = 0.15
STRENGTH_BY = 3.0
RADIUS_WITHIN = 0.01
FOUND_BY = 40.0
SLIP_BIAS = 0.01
WORKING_SLIP, WORKING_WITHIN = 0.083, 0.01
FREE_SLIP = 0.015
CONTROL_STEP = 100e-6
ESTIMATION_STEP = 300e-6


class BagErrors(NamedTuple):
    """Errors of a method on one bag.

    Attributes
    ----------
    rmse : float
        RMSE of slip over all wheels, with the radar noise of the bag.
    worst_rmse : float
        Largest RMSE over this and other seeds of the noise.
    within : tuple of float
        Share of errors within two reported standard deviations: over all seeds and wheels, and
        the smallest of any wheel and seed.
    gap_costs : float
        Increase of the RMSE by a radar gap of `GAP` s, in the gap and 2 s after it.
    """

    rmse: float
    worst_rmse: float
    within: tuple[float, float]
    gap_costs: float


def bag_errors(bags: Path, name: str, method: str) -> BagErrors:
    """Errors of a Kalman filter on a bag.

    Parameters
    ----------
    bags : Path
        Folder of the bags.
    name : str
        Bag.
    method : str
        Kalman filter, as for the parameter `method`.

    Returns
    -------
    BagErrors
        SI units.
    """
    path = bags / name
    runs = [estimate_errors(path, method=method)]
    runs += [estimate_errors(path, method=method, radar_seed=seed) for seed in RENOISED]
    rmse = [run.total_slip_rmse for run in runs]
    within = np.array([run.within_two_sigma for run in runs])
    end = float(read_chrono(path / f'{name}.csv.xz', CHRONO_RUNS[name]).t[-1])
    # In the middle, with a settled estimate before and time to recover after.
    begin = (end - GAP) / 2
    window: dict[str, Any] = {'settle': begin, 'until': begin + GAP + 2.0, 'method': method}
    silent = estimate_errors(path, radar_gap=(begin, begin + GAP), **window)
    heard = estimate_errors(path, **window)
    return BagErrors(
        rmse[0],
        max(rmse),
        (float(within.mean()), float(within.min())),
        silent.total_slip_rmse - heard.total_slip_rmse,
    )


def soil_change(
    bags: Path, name: str, method: str, seed: int | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Error of tau_max under the driven wheels after the last one reached the patch.

    Parameters
    ----------
    bags : Path
        Folder of the bags.
    name : str
        Bag.
    method : str
        Kalman filter, as for the parameter `method`.
    seed : int or None
        Seed of the radar noise; None: noise of the bag.

    Returns
    -------
    t : ndarray, shape (k,)
        Time of every terrain estimate since then, s.
    error : ndarray, shape (k, n)
        Estimated over true tau_max less 1. The true one is that of the patch under static load on
        the nominal contact area, as defined for the estimate.
    """
    run = CHRONO_RUNS[name]
    recording = read_chrono(bags / name / f'{name}.csv.xz', run)
    vehicle = load_vehicle(run.vehicle)
    nominal, soft = (load_soil(soil) for soil in run.soils)
    truth = []
    for wheel, load in zip(vehicle.wheels, vehicle.static_loads(), strict=True):
        area = wheel.width * static_contact_length(nominal, wheel, load)
        truth.append(soft.max_shear_stress(load / area))
    replayed = replay_with_radar(bags / name, method=method, radar_seed=seed)
    terrain = replayed.values('terrain_estimate')
    t = np.array([nanoseconds(each.header.stamp) - replayed.start for each in terrain]) * 1e-9
    found = np.array([each.max_shear_stress for each in terrain])
    # The rear wheel reaches it last.
    entered = recording.x + vehicle.wheel_positions.min() >= run.starts[0]
    last = float(recording.t[np.argmax(entered)] - recording.t[0])
    return t - last, found / np.array(truth) - 1


def bags_section(
    bags: Path,
    run: Callable[[str, Callable[..., Any], list[Any]], list[Any]],
    commit: str,
    quick: bool = False,
) -> tuple[str, list[Target]]:
    """Section of the recorded runs: errors of slip, and changes of soil.

    Parameters
    ----------
    bags : Path
        Folder of the bags.
    run : callable
        Maps a function over arguments, as `Workers.map`.
    commit : str
        Commit of the evaluation.
    quick : bool
        True: only the shipped Kalman filter.

    Returns
    -------
    text : str
        Without heading.
    targets : list of Target
        Targets of the best Kalman filter.

    Raises
    ------
    ValueError
        If a bag does not exist.
    """
    for name in SEEDS:
        if not (bags / name).is_dir():
            raise ValueError(f'{bags} holds no bag {name}: give the folder of the bags (--bags)')
    methods = METHODS[:1] if quick else METHODS
    work = [(name, method) for name in SEEDS for method in methods]
    jobs = [(bags, *each) for each in work]
    found = dict(zip(work, run('bags', bag_errors, jobs), strict=True))
    rows = []
    for name in SEEDS:
        for method in methods:
            errors = found[name, method]
            rows.append(
                [
                    name,
                    method,
                    f'{errors.rmse:.4f}',
                    f'{errors.worst_rmse:.4f}',
                    f'{100 * errors.within[0]:.1f}',
                    f'{100 * errors.within[1]:.1f}',
                    f'{errors.gap_costs:+.4f}',
                ]
            )
    seeds = (None, *RENOISED)
    change_work = [
        (name, method, seed) for name in SOFT_PATCH for seed in seeds for method in methods
    ]
    change_jobs = [(bags, *each) for each in change_work]
    changes = dict(zip(change_work, run('changes of soil', soil_change, change_jobs), strict=True))
    change_rows, strengths = [], {}
    for name in SOFT_PATCH:
        for method in methods:
            cells = []
            for seed in seeds:
                since, error = changes[name, method, seed]
                late = np.abs(error[since >= STRENGTH_BY]).max(axis=1)
                at = np.abs(error[np.argmax(since >= STRENGTH_BY)]).max()
                outside = np.flatnonzero(np.abs(error).max(axis=1) > STRENGTH_WITHIN)
                known = since[outside[-1] + 1] if outside[-1] + 1 < len(since) else np.inf
                cells.append((at, float(np.quantile(late, 0.95)), known))
            at, later, known = np.array(cells).T
            strengths[name, method] = float(at.max())
            change_rows.append(
                [
                    name,
                    method,
                    f'{100 * at[0]:.1f}',
                    f'{100 * at.max():.1f}',
                    f'{100 * later.max():.1f}',
                    ', '.join(f'{each:.1f}' for each in known),
                ]
            )
    best = min(methods, key=lambda m: max(found[name, m].rmse for name in TRACTOR_SPEED))
    chosen = {name: found[name, best] for name in TRACTOR_SPEED}
    worst = max(chosen, key=lambda name: chosen[name].rmse)
    shares = [share for each in chosen.values() for share in each.within[:1]]
    gap = max(each.gap_costs for each in chosen.values())
    strength = max(strengths[name, best] for name in SOFT_PATCH)
    targets = [
        Target(
            f'slip RMSE of the best ({best}) on tractor-speed runs, at most ({worst})',
            f'{chosen[worst].rmse:.4f}',
            f'at most {SLIP_RMSE:g}',
            chosen[worst].rmse <= SLIP_RMSE,
        ),
        Target(
            f'errors inside 2 sigma ({best}, tractor-speed runs)',
            f'{100 * min(shares):.1f} to {100 * max(shares):.1f} %',
            f'{100 * WITHIN[0]:g} to {100 * WITHIN[1]:g} %',
            WITHIN[0] <= min(shares) and max(shares) <= WITHIN[1],
        ),
        Target(
            f'a {GAP:g} s radar gap costs ({best}, tractor-speed runs)',
            f'{gap:+.4f}',
            f'at most {GAP_COSTS:g}',
            gap <= GAP_COSTS,
        ),
        Target(
            f'tau_max off truth {STRENGTH_BY:g} s after the last wheel entered the patch ({best})',
            f'{100 * strength:.1f} %',
            f'at most {100 * STRENGTH_WITHIN:g} %',
            strength <= STRENGTH_WITHIN,
        ),
    ]
    values = {
        'bags': table(
            ('run', 'method', 'slip RMSE', 'worst noise', 'inside 2σ, %', 'least, %', 'gap costs'),
            rows,
        ),
        'changes': table(
            ('run', 'method', f'off after {STRENGTH_BY:g} s, %', 'worst noise', 'later, 95 %',
             f'within {100 * STRENGTH_WITHIN:g} % from, s'),
            change_rows,
        ),
        'noises': str(len(RENOISED)),
        'gap': f'{GAP:g}',
        'sigma': f'{RADAR_SIGMA:g}',
        'radar_rate': f'{1 / (RADAR_EVERY * SAMPLE_TIME):g}',
    }  # fmt: skip
    template = Path(__file__).with_name('bags.template.md')
    checks = target_table(targets)
    return fill(template, **values, commit=commit, bag_checks=checks).strip(), targets


def field_section(folder: Path) -> tuple[str, list[Target]]:
    """Section of the field data.

    Parameters
    ----------
    folder : Path
        Folder of the field data, see `field_data`.

    Returns
    -------
    text : str
        Text without heading.
    targets : list of Target
        Targets of rover and tractor.

    Raises
    ------
    ValueError
        If a file does not exist.
    """
    starts = [0.94 * field_data.ROVER_RADIUS, 1.06 * field_data.ROVER_RADIUS]
    rovers = [field_data.rover(folder, start) for start in starts]
    jumps = field_data.rover_jumps(folder)
    tractors = [field_data.tractor(folder, scale) for scale in (0.94, 1.0, 1.06)]
    rover_rows = [
        [
            f'{each.start_radius:.4f}',
            f'{each.found:.1f}',
            f'{each.radius:.4f} ± {each.deviation:.4f}',
            f'{each.slip_bias:+.4f}',
            f'{each.late_slip_bias:+.4f}',
            f'{100 * each.odometry_error:+.2f}',
            f'{100 * each.uncompensated_error:+.2f}',
        ]
        for each in rovers
    ]
    tractor_rows = [
        [
            f'{each.start_scale:g}',
            f'{each.scale:.4f} ± {each.deviation:.4f}',
            f'{each.calibrated:.0f}',
            *(f'{each.slip[state]:+.4f}' for state in 'MTW'),
            ', '.join(f'{slip:.3f}' for slip in each.slip_by_torque),
            f'{each.rank_correlation:.2f}',
        ]
        for each in tractors
    ]
    first, work = rovers[0], tractors[0]
    free = max(abs(work.slip[state]) for state in 'MT')
    rises = bool(np.all(np.diff(work.slip_by_torque) > 0))
    targets = [
        Target(
            f'rover: radius within {100 * RADIUS_WITHIN:g} % from a 6 % wrong start',
            f'after {first.found:.1f} s',
            f'{FOUND_BY:g} s',
            first.found <= FOUND_BY,
        ),
        Target(
            'rover: slip bias after that',
            f'{first.slip_bias:+.4f}',
            f'±{SLIP_BIAS:g}',
            abs(first.slip_bias) < SLIP_BIAS,
        ),
        Target(
            'rover: jumps of 0.3 m rejected',
            f'{jumps.refused} of {jumps.jumps}',
            'all',
            jumps.refused == jumps.jumps,
        ),
        Target(
            'tractor: median slip at work',
            f'{work.slip["W"]:.4f}',
            f'{WORKING_SLIP:g} ± {WORKING_WITHIN:g}',
            abs(work.slip['W'] - WORKING_SLIP) <= WORKING_WITHIN,
        ),
        Target(
            'tractor: median slip on road and turning, off zero',
            f'{free:.4f}',
            f'at most {FREE_SLIP:g}',
            free <= FREE_SLIP,
        ),
        Target(
            'tractor: slip rises with engine torque, fifth by fifth',
            'yes' if rises else 'no',
            'yes',
            rises,
        ),
    ]
    values = {
        'rover': table(
            ('start, m', 'within 1 % from, s', 'radius at 40 s, m', 'slip bias from then',
             'from 40 s', 'odometry error, %', 'without calibration, %'),
            rover_rows,
        ),
        'jumps': f'{jumps.refused} of {jumps.jumps}',
        'tractor': table(
            ('start', 'found', 'known to 1 % from, s', 'slip M', 'slip T', 'slip W',
             'slip by rising engine torque', 'rank correlation'),
            tractor_rows,
        ),
    }  # fmt: skip
    template = Path(__file__).with_name('field.template.md')
    text = fill(template, **values, checks=target_table(targets)).strip()
    return text, targets


def step_time_targets(control: float, estimation: float) -> list[Target]:
    """Targets of the time of a step.

    Parameters
    ----------
    control, estimation : float
        Median time of a step of the LPV controller and of the estimator, s.

    Returns
    -------
    list of Target
        Targets for four wheels.
    """
    return [
        Target(
            f'{what}: step of four wheels',
            f'{1e6 * found:.0f} us',
            f'at most {1e6 * most:g} us',
            found <= most,
        )
        for what, found, most in (
            ('LPV controller', control, CONTROL_STEP),
            ('estimator', estimation, ESTIMATION_STEP),
        )
    ]


def step_time(step: Callable[[], None], count: int = 3000) -> float:
    """Median time of a step after warm-up.

    Parameters
    ----------
    step : callable
        One step.
    count : int
        Number of timed steps, at least 10.

    Returns
    -------
    float
        s.
    """
    for _ in range(count // 10):
        step()
    times = np.empty(count)
    for k in range(count):
        begun = time.perf_counter()
        step()
        times[k] = time.perf_counter() - begun
    return float(np.median(times))
