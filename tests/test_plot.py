"""`traction plot` as it is called."""

import shutil
import subprocess
from pathlib import Path

from traction_node.probe import executable

DRAWBAR = Path(__file__).resolve().parents[1] / 'bags' / 'wheel_drawbar'


def test_the_bag_may_be_the_working_directory(tmp_path, monkeypatch):
    monkeypatch.chdir(shutil.copytree(DRAWBAR, tmp_path / 'run.2'))
    done = subprocess.run(
        [str(executable('traction_bringup', 'traction')), 'plot', '.'],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.returncode, done.stderr) == (0, '')
    # Beside the bag; a dot in its name is no suffix.
    assert (tmp_path / 'run.2.png').is_file()
