"""Pytest fixture `replay`: replay of the user's bags in the user's tests."""

from pathlib import Path

import pytest


@pytest.fixture
def replay(request):
    """Replay of a bag through estimator, controller and gate: `replay(bag)` returns a `Replay`.

    A relative path starts at the folder of the test. Keywords are those of
    `traction_evaluation.replay.replay.replay`, and `against`, a golden file or bag. If the outputs
    differ from it, the test fails with the first message and field of each topic.
    """
    # Imported here, since pytest loads this module in every run.
    from traction_evaluation.replay.golden import compare
    from traction_evaluation.replay.replay import replay as run_replay

    folder = request.path.parent

    def run(bag, *, against=None, **keywords):
        result = run_replay(folder / Path(bag), **keywords)
        if against is not None:
            found = compare(result, folder / Path(against))
            if found:
                where = '; '.join(map(str, found))
                pytest.fail(f'{bag} differs from {against}: {where}', pytrace=False)
        return result

    return run
