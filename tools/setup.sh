#!/bin/sh
# Finds a Python that set-up can work with, and runs set-up with it.
#
# usage: setup.sh [PYTHON]    PYTHON: the interpreter to use; otherwise the one of an existing
#                             .venv, the one of an installed ROS, or the newest found
cd "$(dirname "$0")/.." || exit 1

# Prints what is missing from the interpreter "$1"; nothing if it will do. The candidate is run,
# not just looked up: version managers put commands on the PATH that only print an error.
missing() {
    if ! command -v "$1" >/dev/null; then
        echo 'is not there'
        return
    fi
    "$1" -S -c '
import sys
version = "%d.%d" % sys.version_info[:2]
if not (3, 11) <= sys.version_info[:2] <= (3, 13):
    sys.exit("is Python %s; 3.11, 3.12 or 3.13 is needed" % version)
import importlib.util, os, sysconfig
if not (importlib.util.find_spec("venv") and importlib.util.find_spec("ensurepip")):
    sys.exit("lacks venv: install the package python%s-venv" % version)
if not os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h")):
    sys.exit("lacks the header Python.h: install the package python%s-dev" % version)
' 2>&1 || echo 'does not run'
}

if [ -n "$1" ]; then
    candidates=$1
elif [ -x .venv/bin/python ] && [ -z "$(missing .venv/bin/python)" ]; then
    candidates=.venv/bin/python
elif [ -d /opt/ros/jazzy ]; then
    candidates=/usr/bin/python3
else
    candidates='python3.13 python3.12 python3.11 python3'
fi

reason=
for python in $candidates; do
    found=$(missing "$python" | head -n 1)
    if [ -z "$found" ]; then
        exec "$python" -S tools/setup.py
    fi
    reason="$python $found"
done
echo "setup: $reason (make setup PYTHON=/path/to/python3.12 chooses another)" >&2
exit 1
