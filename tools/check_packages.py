"""Check the ROS packages of the workspace: `make lint`.

Each `package.xml` must be valid without warnings, and name, version, description, licence and
maintainer must be the same in `package.xml` and `setup.py`; all packages have one version.
"""

import subprocess
import sys
from pathlib import Path

from catkin_pkg.package import InvalidPackage, parse_package

FIELDS = ('name', 'version', 'description', 'license', 'maintainer', 'maintainer-email')


def setup_fields(folder):
    """Metadata of a package in its `setup.py`, by field.

    Parameters
    ----------
    folder : pathlib.Path
        Folder of the package.
    """
    output = subprocess.run(
        [sys.executable, 'setup.py', *(f'--{field}' for field in FIELDS)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    return dict(zip(FIELDS, output[-len(FIELDS) :], strict=True))


def package_fields(package):
    """Metadata of a package in `package.xml`, by the same fields."""
    maintainer = package.maintainers[0]
    return {
        'name': package.name,
        'version': package.version,
        'description': ' '.join(package.description.split()),
        'license': ', '.join(package.licenses),
        'maintainer': maintainer.name,
        'maintainer-email': maintainer.email,
    }


def problems(src):
    """Faults of the packages in a folder.

    Parameters
    ----------
    src : pathlib.Path
        Folder with one folder for each package.

    Returns
    -------
    list of str
        One line for each problem, naming the file.
    """
    found = []
    versions = {}
    for xml in sorted(src.glob('*/package.xml')):
        folder = xml.parent
        warnings = []
        try:
            package = parse_package(str(xml), warnings=warnings)
        except InvalidPackage as error:
            found.append(f'{xml}: {" ".join(str(error).split())}')
            continue
        found += [f'{xml}: {" ".join(warning.split())}' for warning in warnings]
        if package.name != folder.name:
            found.append(f'{xml}: names {package.name}, but lies in {folder.name}')
        versions.setdefault(package.version, []).append(package.name)
        if (folder / 'setup.py').exists():
            stated, told = package_fields(package), setup_fields(folder)
            found += [
                f'{xml}: {field} is "{stated[field]}", but "{told[field]}" in setup.py'
                for field in FIELDS
                if stated[field] != told[field]
            ]
    if len(versions) > 1:
        listed = '; '.join(f'{v}: {", ".join(names)}' for v, names in sorted(versions.items()))
        found.append(f'{src}: packages have different versions ({listed})')
    return found


if __name__ == '__main__':
    lines = problems(Path(__file__).resolve().parents[1] / 'ros2_ws' / 'src')
    print('\n'.join(lines or ['package.xml files are valid']))
    sys.exit(1 if lines else 0)
