"""What `make evaluate` says of estimation: field data, and the time that steps take."""

import time

import field_data
import numpy as np

# Targets.
RADIUS_WITHIN = 0.01
FOUND_BY = 40.0
SLIP_BIAS = 0.01
WORKING_SLIP, WORKING_WITHIN = 0.083, 0.01
FREE_SLIP = 0.015
CONTROL_STEP = 100e-6
ESTIMATION_STEP = 300e-6


def field_section(table):
    """Tables of the field data, and targets: what, found, limit as text, and whether it is met."""
    starts = [0.94 * field_data.ROVER_RADIUS, 1.06 * field_data.ROVER_RADIUS]
    rovers = [field_data.rover(start) for start in starts]
    jumps = field_data.rover_jumps()
    tractors = [field_data.tractor(scale) for scale in (0.94, 1.0, 1.06)]
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
    verdict = [
        (
            f'rover: radius within {100 * RADIUS_WITHIN:g} % from a 6 % wrong start',
            f'after {first.found:.1f} s',
            f'{FOUND_BY:g} s',
            first.found <= FOUND_BY,
        ),
        (
            'rover: slip bias after that',
            f'{first.slip_bias:+.4f}',
            f'±{SLIP_BIAS:g}',
            abs(first.slip_bias) < SLIP_BIAS,
        ),
        (
            'rover: jumps of 0.3 m rejected',
            f'{jumps.refused} of {jumps.jumps}',
            'all',
            jumps.refused == jumps.jumps,
        ),
        (
            'tractor: median slip at work',
            f'{work.slip["W"]:.4f}',
            f'{WORKING_SLIP:g} ± {WORKING_WITHIN:g}',
            abs(work.slip['W'] - WORKING_SLIP) <= WORKING_WITHIN,
        ),
        (
            'tractor: median slip on road and turning, off zero',
            f'{free:.4f}',
            f'at most {FREE_SLIP:g}',
            free <= FREE_SLIP,
        ),
        (
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
    return values, verdict


def step_time(step, count=3000):
    """Median time of a step, s, once everything is warm."""
    for _ in range(count // 10):
        step()
    times = np.empty(count)
    for k in range(count):
        begun = time.perf_counter()
        step()
        times[k] = time.perf_counter() - begun
    return float(np.median(times))
