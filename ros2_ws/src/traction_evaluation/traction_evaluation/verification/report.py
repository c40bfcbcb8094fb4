"""Report on the model against Project Chrono, the paper and a sand bed: docs/verification.md."""

import sys
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from traction_evaluation.markdown import fill, said, section, target_table
from traction_evaluation.verification.ablation import ABLATIONS, ablate, ablation_tables
from traction_evaluation.verification.braking import BRAKED_RUN, braking_tables, follow_braked
from traction_evaluation.verification.chrono import CHRONO_RUNS, ChronoRecording, read_chrono
from traction_evaluation.verification.paper_table import PAPER_AREA, paper_table, paper_target
from traction_evaluation.verification.pictures import (
    draw_braking,
    draw_rig,
    draw_runs,
    draw_steps,
)
from traction_evaluation.verification.run_errors import (
    FORMS,
    HEADINGS,
    axle_table,
    cells,
    error_table,
    follow_runs,
    run_targets,
)
from traction_evaluation.verification.sand_bed import (
    SAND_BED,
    draw_sand_bed,
    sand_bed_section,
    sand_bed_target,
)
from traction_evaluation.verification.soil_bin import compare_sand_bed
from traction_evaluation.verification.torque_steps import step_table
from traction_evaluation.verification.verification import (
    CHRONO_STEP,
    FOLLOWED,
    LIMITS,
    START,
    errors,
)
from traction_evaluation.verification.wheel_rig import (
    RIG_FILE,
    read_rig,
    rig_errors,
    rig_table,
    rig_targets,
)
from traction_model.contact.contact import Form

SAND_BED_HEADING = '## 8. A single wheel in a sand bed'


def read_run(bags: Path, name: str) -> ChronoRecording:
    """Read the recording of a run beside its bag.

    Parameters
    ----------
    bags : Path
        Folder of the bags.
    name : str
        The run.

    Returns
    -------
    ChronoRecording
        SI units.

    Raises
    ------
    ValueError
        If the recording is not there.
    """
    path = bags / name / f'{name}.csv.xz'
    if not path.is_file():
        raise ValueError(f'{path} is not there: give the folder of the bags (--bags)')
    return read_chrono(path, CHRONO_RUNS[name])


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
        Exit status: 0, or 1 if a target is missed.

    Raises
    ------
    ValueError
        If a recording does not exist.
    """
    # Output to a file has no terminal width.
    console = Console(width=None if sys.stdout.isatty() else 150)
    images = docs / 'images'
    images.mkdir(parents=True, exist_ok=True)

    recordings = {name: read_run(bags, name) for name in FOLLOWED}
    braked = read_run(bags, BRAKED_RUN)
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(
            'following Chrono', total=len(recordings) * (len(FORMS) + len(ABLATIONS))
        )
        runs = follow_runs(recordings, lambda: progress.advance(task))
        ablations = ablate(recordings, lambda: progress.advance(task))
    table_3, whole_steps = paper_table(recordings, runs)
    braked_motion = follow_braked(braked)
    found = {name: runs.found[name, Form.CONTACT, False] for name in recordings}
    found[BRAKED_RUN] = errors(braked, braked_motion)
    points = read_rig(bags / RIG_FILE)
    told, untold = (rig_errors(points, told_patch=each) for each in (True, False))

    for kind in ('wheel', 'tractor'):
        of_kind = [name for name in recordings if name.startswith(kind)]
        draw_runs(recordings, runs, of_kind, images / f'verification_{kind}.png')
    draw_steps(recordings, runs, images / 'verification_steps.png')
    draw_braking(braked, braked_motion, images / 'verification_braking.png')
    draw_rig(told, untold, images / 'verification_rig.png')

    summary = Table(title='contact form against Chrono, sinkage predicted')
    for heading in ('run', *HEADINGS):
        summary.add_column(heading, justify='left' if heading == 'run' else 'right')
    for name, each in found.items():
        summary.add_row(name, *cells(each))
    for name, each in whole_steps.items():
        summary.add_row(f'{name}, shear by whole steps', *cells(each))
    console.print(summary)

    targets = [*run_targets(found), *rig_targets(told), paper_target(whole_steps)]
    if field_data is not None:
        sand_bed_file = field_data / SAND_BED
        if not sand_bed_file.is_file():
            raise ValueError(f'{sand_bed_file} is not there: give the folder of the field data')
        comparisons = compare_sand_bed(sand_bed_file)
        draw_sand_bed(comparisons, images / 'verification_sand_bed.png')
        sand_bed = sand_bed_section(comparisons)
        bed_targets = [sand_bed_target(comparisons)]
    else:
        sand_bed = section(docs / 'verification.md', SAND_BED_HEADING)
        bed_targets = []
        console.print('sand bed: section kept: no field data given')
    for line in said([*targets, *bed_targets]):
        console.print(line, highlight=False)

    text = fill(
        Path(__file__).with_name('verification.template.md'),
        runs=len(LIMITS),
        start=f'{START:g}',
        step=f'{1e3 * CHRONO_STEP:g}',
        area=f'{PAPER_AREA:g}',
        targets=target_table(targets),
        predicted=error_table(runs, fed=False),
        fed=error_table(runs, fed=True),
        axles=axle_table(recordings, runs),
        steps=step_table(recordings, runs),
        rig=rig_table(told, untold),
        points=len(told.slip),
        low_rim=f'{recordings["wheel_low_slip"].rim_speed.max():.0f}',
        high_rim=f'{recordings["wheel_high_slip"].rim_speed.max():.0f}',
        paper=table_3,
        sand_bed=sand_bed,
        **braking_tables(braked, braked_motion, found[BRAKED_RUN]),
        **ablation_tables(ablations),
    )
    (docs / 'verification.md').write_text(text, encoding='utf-8')
    console.print(f'report   {docs / "verification.md"}', soft_wrap=True)
    return 0 if all(each.met for each in [*targets, *bed_targets]) else 1
