"""Environment variables of a ROS 2 interpreter for this workspace.

This is the one place that knows them. Set-up works them out once, by asking ROS's own scripts,
and records them in the virtual environment (`record`). Each start of `.venv/bin/python` then runs
`enter`: it adds what is missing and starts the interpreter once more, because the dynamic linker
reads `LD_LIBRARY_PATH` only at the start of a process. Child processes inherit the result and
do not start twice.

Set-up copies this file into the virtual environment, so it uses the standard library only.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

RECORD = 'ros_environment.json'
# Colcon's script prints the changes of variables for a shell; it needs the original values.
COLCON_SCRIPT = '_local_setup_util_sh.py'
# Variables of the shell or of the process, not of ROS.
NOT_RECORDED = {'_', 'PWD', 'OLDPWD', 'SHLVL'}


def wheels(prefix):
    """Variables for the ROS 2 wheels installed in the virtual environment `prefix`.

    Parameters
    ----------
    prefix : path-like
        Folder of the virtual environment.

    Returns
    -------
    dict of str
        To be set in an otherwise clean environment.
    """
    prefix = Path(prefix)
    bundled = sorted(prefix.glob('lib/python3*/site-packages/ros_*.libs'))
    return {
        'AMENT_PREFIX_PATH': str(prefix),
        'CMAKE_PREFIX_PATH': str(prefix),
        'LD_LIBRARY_PATH': os.pathsep.join(map(str, [prefix / 'lib', *bundled])),
        'ROS_DISTRO': 'jazzy',
        'ROS_PYTHON_VERSION': '3',
        'ROS_VERSION': '2',
        # Prevents a restart of the interpreter by the wheels, with folders in random order.
        '_ROS_WHEELS_BOOTSTRAP_COMPLETE': '1',
    }


def sourced(script, environment):
    """Environment after sourcing a bash script.

    Parameters
    ----------
    script : path-like
        Such as /opt/ros/jazzy/setup.bash.
    environment : dict of str
        Environment to source it in.

    Returns
    -------
    dict of str
        Environment as it stands afterwards.
    """
    result = subprocess.run(
        ['bash', '--norc', '-c', '. "$1" >&2 && env -0', 'bash', str(script)],
        env=environment,
        check=True,
        capture_output=True,
    )
    pairs = result.stdout.decode().split('\0')
    return dict(pair.split('=', 1) for pair in pairs if pair)


def completed(environment, recorded):
    """Environment completed by the recorded variables.

    Parameters
    ----------
    environment : dict of str
        Environment of a process.
    recorded : dict of str
        Variables as set-up found them. In a variable that lists folders, what is missing goes
        in front; what is there already keeps its place.

    Returns
    -------
    dict of str
        Equal to `environment` where nothing is missing.
    """
    result = dict(environment)
    for name, value in recorded.items():
        if name.endswith('PATH'):
            present = [entry for entry in result.get(name, '').split(os.pathsep) if entry]
            missing = [entry for entry in value.split(os.pathsep) if entry not in present]
            if missing:
                result[name] = os.pathsep.join(missing + present)
        else:
            result.setdefault(name, value)
    return result


def record(prefix, environment, clean):
    """Record, in a virtual environment, the variables for `enter`.

    Parameters
    ----------
    prefix : path-like
        Folder of the virtual environment.
    environment, clean : dict of str
        Environment with ROS and the workspace; environment without them.
    """
    recorded = {}
    for name in sorted(environment.keys() - NOT_RECORDED):
        if environment[name] == clean.get(name):
            continue
        value = environment[name]
        if name.endswith('PATH'):
            known = clean.get(name, '').split(os.pathsep)
            value = os.pathsep.join(e for e in value.split(os.pathsep) if e and e not in known)
        recorded[name] = value
    Path(prefix, RECORD).write_text(json.dumps(recorded, indent=1), encoding='utf-8')


def enter():
    """Complete the environment of this interpreter, with one restart if necessary."""
    if sys.orig_argv[1:] and Path(sys.orig_argv[1]).name == COLCON_SCRIPT:
        return
    try:
        recorded = json.loads(Path(sys.prefix, RECORD).read_text(encoding='utf-8'))
    except FileNotFoundError:
        return
    environment = completed(os.environ, recorded)
    if environment != dict(os.environ):
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], environment)
