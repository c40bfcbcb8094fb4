"""Effect of each part of the contact form on its errors on the Chrono runs, sinkage predicted."""

from collections.abc import Callable, Mapping
from typing import Any

from traction_evaluation.markdown import table
from traction_evaluation.verification.chrono import ChronoRecording
from traction_evaluation.verification.verification import Errors, errors, follow
from traction_model.soil.soil import load_soil
from traction_model.soil.terrain import Terrain

# (text, arguments of `follow`, changes of every soil)
ABLATIONS: tuple[tuple[str, dict[str, Any], dict[str, Any]], ...] = (
    ('nothing changed', {}, {}),
    ("Chrono's sinkage fed", {'fed': True}, {}),
    ('shear by whole steps', {'whole_steps': True}, {}),
    ('fresh soil for all wheels', {'multipass': False}, {}),
    ('ruts forget shear', {}, {'shear_memory': 0.0}),
    ('no springing back', {}, {'elastic_modulus': None}),
    ('no damping', {}, {'damping': 0.0}),
)


def ablate(
    recordings: Mapping[str, ChronoRecording], progress: Callable[[], None]
) -> dict[str, dict[str, Errors]]:
    """Simulate all runs with one part of the model changed at a time.

    Parameters
    ----------
    recordings : mapping of str to ChronoRecording
        Runs by name.
    progress : callable
        Called after each part and run.

    Returns
    -------
    dict of str to dict of str to Errors
        Errors by change and run; m/s, rad/s, dimensionless.
    """
    found: dict[str, dict[str, Errors]] = {}
    for text, arguments, changes in ABLATIONS:
        found[text] = {}
        for name, recording in recordings.items():
            run = recording.run
            soils = [load_soil(soil).model_copy(update=changes) for soil in run.soils]
            terrain = Terrain(soils, run.starts)
            found[text][name] = errors(recording, follow(recording, terrain=terrain, **arguments))
            progress()
    return found


def ablation_tables(found: Mapping[str, Mapping[str, Errors]]) -> dict[str, str]:
    """Tables of mean errors.

    Parameters
    ----------
    found : mapping of str to mapping of str to Errors
        As of `ablate`; m/s, rad/s, dimensionless.

    Returns
    -------
    dict of str to str
        Markdown: ``ablation_v``, ``ablation_omega``, ``ablation_slip``.
    """
    names = list(next(iter(found.values())))
    return {
        f'ablation_{quantity}': table(
            ('change', *names),
            (
                [text, *(f'{getattr(by_run[name], f"{quantity}_mean"):.{digits}f}'
                         for name in names)]
                for text, by_run in found.items()
            ),
        )
        for quantity, digits in (('v', 3), ('omega', 3), ('slip', 4))
    }  # fmt: skip
