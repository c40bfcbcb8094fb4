"""Report on the model against Project Chrono, the paper and a sand bed: docs/verification.md."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import track
from rich.table import Table

from traction_evaluation.markdown import fill, section, table
from traction_evaluation.verification.chrono import (
    CHRONO_RUNS,
    SAMPLE_TIME,
    read_chrono,
)
from traction_evaluation.verification.soil_bin import compare_sand_bed
from traction_evaluation.verification.verification import (
    CONTACT_OFFSET,
    LIMITS,
    NOT_REACHED,
    PAPER_TABLE_3,
    PREDICTED_FACTOR,
    SHEAR_STEP,
    START,
    Errors,
    errors,
    exceeded,
    follow,
)
from traction_model.contact.contact import Form
from traction_model.soil.empirical import rms
from traction_model.soil.terrain import Terrain

SAND_BED = 'single_wheel_sand.csv'
"""File of the field data: C. Pavlov and A. M. Johnson, Carnegie Mellon University
(3d-terramechanics); not part of this project."""

SAND_BED_LIMIT = 0.05
"""Limit of the RMS error of drawbar over load, fitted, on the tested half."""

SAND_BED_HEADING = '## 4. A single wheel in a sand bed'

FORMS = (Form.PAPER, Form.BEKKER_WONG, Form.CONTACT)
HEADINGS = ('v max, m/s', 'v mean', 'ω max, rad/s', 'ω mean', 'slip max', 'slip mean')
AVERAGED = 9  # samples, odd
DIGITS = (3, 3, 3, 3, 4, 4)

# Parts of the contact form to leave out, one at a time: (text, arguments of `follow`).
WITHOUT: tuple[tuple[str, dict[str, Any]], ...] = (
    ('all of it', {}),
    ('no contact offset', {'offset': 0.0}),
    ('no shear step', {'shear_step': 0.0}),
    ('neither', {'offset': 0.0, 'shear_step': 0.0}),
    ('fresh soil for all wheels', {'multipass': False}),
)


def cells(found, limits=None, factor=1.0):
    """Cells of a row: errors, bold if above their limit."""
    row = []
    for k, value in enumerate(found):
        text = f'{value:.{DIGITS[k]}f}'
        row.append(f'**{text}**' if limits and value > factor * limits[k] else text)
    return row


def draw_runs(recordings, motions, path):
    """Draw speed, slip and sinkage of Chrono and the model, one row per run."""
    figure = Figure(figsize=(13, 2.5 * len(recordings)), layout='constrained')
    axes = figure.subplots(len(recordings), 3, squeeze=False)
    for (name, recording), (speed, slip, sinkage) in zip(recordings.items(), axes, strict=True):
        fed, predicted = motions[name]
        first = slice(len(recording.t) - len(fed.t), None)
        # The last wheel: of the tractor, one that runs in a rut.
        slips = recording.slip[first, -1]
        for axis, chronos, quantity in (
            (speed, recording.v[first], 'v'),
            (slip, slips, 'slip'),
            (sinkage, recording.sinkage[first, -1], 'sinkage'),
        ):
            axis.plot(fed.t, chronos, color='#444444', lw=2.4, alpha=0.6, label='Chrono')
            for motion, colour, style, label in (
                (predicted, '#D55E00', '-', 'predicted'),
                (fed, '#0072B2', '--', 'sinkage fed'),
            ):
                if motion is fed and axis is sinkage:
                    continue
                values = getattr(motion, quantity).reshape(len(motion.t), -1)[:, -1]
                axis.plot(motion.t, values, color=colour, ls=style, lw=1, label=label)
            axis.grid(alpha=0.25)
        speed.set_ylabel(f'{name}\nspeed, m/s')
        slip.set_ylabel('slip')
        slip.set_ylim(-0.05, 1.05 if slips.max() > 0.6 else 0.5)
        sinkage.set_ylabel('sinkage, m')
    for axis in axes[-1]:
        axis.set_xlabel('time, s')
    axes[0, 0].legend(fontsize=8)
    figure.savefig(path, dpi=90)


def draw_sand_bed(comparisons, path):
    """Draw drawbar over load against slip: measured, published soil, fitted."""
    figure = Figure(figsize=(11, 3.8), layout='constrained')
    for (name, found), axis in zip(
        comparisons.items(), figure.subplots(1, len(comparisons), sharey=True), strict=True
    ):
        slip, measured = found.trials.slip, found.trials.drawbar_ratio
        for half, mark, label in (
            (found.fitted_half, 'o', 'measured, fitted'),
            (found.tested_half, 's', 'measured, tested'),
            (~found.within, 'x', 'measured, braking: not fitted'),
        ):
            axis.plot(slip[half], measured[half], mark, color='#444444', ms=5, label=label)
        axis.plot(slip, found.unfitted.drawbar_ratio, color='#D55E00', label="authors' soil")
        axis.plot(slip, found.fitted.drawbar_ratio, color='#0072B2', label='fitted')
        axis.set_title(name)
        axis.set_xlabel('slip')
        axis.grid(alpha=0.25)
        axis.legend(fontsize=8)
    figure.axes[0].set_ylabel('drawbar over load')
    figure.savefig(path, dpi=90)


def chrono_section(recordings, motions, found):
    """Sections of the report on Chrono and the paper."""
    fed_rows, predicted_rows, paper_rows = [], [], []
    for name in recordings:
        for form in FORMS:
            key = LIMITS[name] if form is Form.CONTACT else None
            fed_rows.append([name, form.name.lower(), *cells(found[name, form, True], key)])
            predicted_rows.append(
                [name, form.name.lower(), *cells(found[name, form, False], key, PREDICTED_FACTOR)]
            )
    for name, paper in PAPER_TABLE_3.items():
        ours = found[name, Form.CONTACT, True]
        paper_rows.append([name, "the paper's model", *cells(paper)])
        paper_rows.append([name, '`contact`', *cells(ours, paper)])
        paper_rows.append(
            [name, 'ours over theirs', *(f'{a / b:.2f}' for a, b in zip(ours, paper, strict=True))]
        )
    ablation = []
    for text, arguments in WITHOUT:
        row = [text]
        for recording in recordings.values():
            row.append(f'{errors(recording, follow(recording, **arguments)).v_mean:.3f}')
        ablation.append(row)
    for text, modulus in (('soil that does not spring back', None), ('soil that does', 4e7)):
        row = [text]
        for recording in recordings.values():
            run = recording.run.terrain()
            soils = [soil.model_copy(update={'elastic_modulus': modulus}) for soil in run.soils]
            motion = follow(recording, terrain=Terrain(soils, run.starts[1:].tolist()))
            row.append(f'{errors(recording, motion).v_mean:.3f}')
        ablation.append(row)

    low = recordings['wheel_low_slip']
    fed, _ = motions['wheel_low_slip']
    first = len(low.t) - len(fed.t)
    chronos = low.slip[first:, 0]
    off = np.abs(fed.slip[:, 0] - chronos)
    worst = int(off.argmax())
    jumps = np.abs(np.diff(chronos))
    averaged = np.convolve(chronos, np.full(AVERAGED, 1 / AVERAGED), 'valid')
    half = AVERAGED // 2
    smooth = np.abs(fed.slip[half:-half, 0] - averaged).max()
    headings = ('run', 'form', *HEADINGS)
    return {
        'fed': table(headings, fed_rows),
        'predicted': table(headings, predicted_rows),
        'factor': f'{PREDICTED_FACTOR:g}',
        'ablation': table(('with', *recordings), ablation),
        'offset': f'{1e3 * CONTACT_OFFSET:g}',
        'step': f'{1e3 * SHEAR_STEP:g}',
        'paper': table(headings, paper_rows),
        'above': int((off > LIMITS['wheel_low_slip'].slip_max).sum()),
        'samples': len(off),
        'span': f'{1e3 * AVERAGED * SAMPLE_TIME:g}',
        'smooth': f'{smooth:.4f}',
        'worst': f'{fed.t[worst]:.2f}',
        'jump': f'{jumps.max():.3f}',
        'jump99': f'{np.quantile(jumps, 0.99):.3f}',
    }


def sand_bed_section(comparisons):
    """Table of the tests in a sand bed."""
    rows = []
    for name, each in comparisons.items():
        rows.append(
            [
                name,
                str(int(each.within.sum())),
                f'{rms(each.errors(each.unfitted, each.within)):.3f}',
                f'{rms(each.errors(each.fitted, each.fitted_half)):.3f}',
                f'{rms(each.errors(each.fitted, each.tested_half)):.3f}',
                f'{each.strength_share:.3f}',
                f'{1e3 * each.shear_deformation_modulus:.2f}',
                f'{rms(each.errors(each.unfitted, ~each.within)):.2f}',
            ]
        )
    headings = (
        'wheel', 'trials', 'RMS, published soil', 'RMS, fitted half', 'RMS, tested half',
        'share of strength', 'K, mm', 'RMS braking, published soil',
    )  # fmt: skip
    template = Path(__file__).with_name('sand_bed.template.md')
    return fill(template, table=table(headings, rows))


def verify(docs: Path, bags: Path, field_data: Path | None = None) -> int:
    """Compare the model with all recordings and write the report.

    Parameters
    ----------
    docs : Path
        Folder of ``verification.md`` and of ``images``.
    bags : Path
        Folder of the bags, with the recordings of Project Chrono.
    field_data : Path, optional
        Folder of the field data; without it the section of the sand bed is kept.

    Returns
    -------
    int
        Exit status: 0, or 1 if an expected limit does not hold.

    Raises
    ------
    ValueError
        If a recording does not exist.
    """
    # Output to a file has no terminal width.
    console = Console(width=None if sys.stdout.isatty() else 150)
    (docs / 'images').mkdir(parents=True, exist_ok=True)

    recordings = {}
    for name, run in CHRONO_RUNS.items():
        path = bags / name / f'{name}.csv.xz'
        if not path.is_file():
            raise ValueError(f'{path} is not there: give the folder of the bags (--bags)')
        recordings[name] = read_chrono(path, run)
    found, motions = {}, {}
    work = [(name, form) for name in recordings for form in FORMS]
    for name, form in track(work, 'following Chrono', console=console, transient=True):
        pair = [follow(recordings[name], form, fed=fed) for fed in (True, False)]
        for fed, motion in zip((True, False), pair, strict=True):
            found[name, form, fed] = errors(recordings[name], motion)
        if form is Form.CONTACT:
            motions[name] = pair

    for kind in ('wheel', 'tractor'):
        of_kind = {name: run for name, run in recordings.items() if name.startswith(kind)}
        draw_runs(of_kind, motions, docs / 'images' / f'verification_{kind}.png')

    summary = Table(title='contact form against Chrono')
    for heading in ('run', *HEADINGS, 'not met'):
        summary.add_column(heading, justify='left' if heading in ('run', 'not met') else 'right')
    unexpected = False
    for fed, factor in ((True, 1.0), (False, PREDICTED_FACTOR)):
        for name in recordings:
            row = found[name, Form.CONTACT, fed]
            limits = LIMITS[name]
            missed = exceeded(row, limits, factor)
            unexpected |= not set(missed) <= set(NOT_REACHED.get(name, []) if fed else [])
            summary.add_row(
                f'{name}{"" if fed else ", predicted"}',
                *(f'{v:.{d}f}' for v, d in zip(row, DIGITS, strict=True)),
                '; '.join(
                    f'{heading}: {value:.4g} > {factor * limit:.4g}'
                    for heading, field, value, limit in zip(
                        HEADINGS, Errors._fields, row, limits, strict=True
                    )
                    if field in missed
                ),
            )
    console.print(summary)

    if field_data is not None:
        sand_bed_file = field_data / SAND_BED
        if not sand_bed_file.is_file():
            raise ValueError(f'{sand_bed_file} is not there: give the folder of the field data')
        comparisons = compare_sand_bed(sand_bed_file)
        draw_sand_bed(comparisons, docs / 'images' / 'verification_sand_bed.png')
        sand_bed = sand_bed_section(comparisons)
        tested = np.concatenate(
            [each.errors(each.fitted, each.tested_half) for each in comparisons.values()]
        )
        unfitted = np.concatenate(
            [each.errors(each.unfitted, each.within) for each in comparisons.values()]
        )
        console.print(
            f'sand bed: RMS of drawbar over load {rms(tested):.4f} fitted (limit '
            f'{SAND_BED_LIMIT:g}, tested half), {rms(unfitted):.4f} unfitted'
        )
        unexpected |= rms(tested) > SAND_BED_LIMIT
    else:
        sand_bed = section(docs / 'verification.md', SAND_BED_HEADING)
        console.print('sand bed: section left as it was: no field data were given')

    text = fill(
        Path(__file__).with_name('verification.template.md'),
        runs=len(recordings),
        start=f'{START:g}',
        sand_bed=sand_bed.strip(),
        **chrono_section(recordings, motions, found),
    )
    (docs / 'verification.md').write_text(text, encoding='utf-8')
    console.print(f'report   {docs / "verification.md"}', soft_wrap=True)
    return int(unexpected)
