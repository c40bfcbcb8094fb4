"""The pytest fixture `replay`: bags of one's own through the suite, in tests of one's own."""

from pathlib import Path

import pytest


@pytest.fixture
def replay(request):
    """Send a bag through estimator, controller and gate: `replay(bag)` gives a `Replay`.

    A relative path counts from the folder of the test. Keywords are those of
    `traction_evaluation.replay.replay.replay`, and `against`, a golden file or bag: where the
    outputs differ from it, the test fails and names the first message and field of each topic.
    """
    # Imported here: pytest loads this module in each of its runs.
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
