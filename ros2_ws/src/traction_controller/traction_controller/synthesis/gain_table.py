"""Gain tables of the law `lpv`: gains of a vehicle's wheels with certificate, as a YAML file.

Gains are functions of the slip pole (see `traction_controller.synthesis.slip_loop`). The gain on
the slip error is stored over G, so one list suits all wheels.
"""

import hashlib
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import yaml
from ament_index_python.packages import get_package_share_directory
from pydantic import Field

from traction_controller.synthesis.certificate import Certificate, CertificateError, Margins, check
from traction_controller.synthesis.slip_loop import slip_pole, torque_scale
from traction_model.definition import Definition, build, read_yaml
from traction_model.vehicle.vehicle import Vehicle
from traction_model.vehicle.wheel import Wheel
from traction_node.closest import closest

FORMAT: Literal['traction gain table 1'] = 'traction gain table 1'
"""Name of the file format."""


class GainTableError(ValueError):
    """A gain table must not be used; the text has the reason."""


class Scheduling(Definition):
    """Conversion of rim speed and slip stiffness into slip pole and torque scale.

    Attributes
    ----------
    slip : float
        Slip at the operating point, at least 0 and below 1.
    stiffness : float
        Largest slip stiffness, over static load, dimensionless, above 0; gains are constant above
        it.
    rim_speed : tuple of float
        Smallest and largest rim speed, m/s, above 0; gains are constant below the smallest.
    """

    slip: float = Field(default=0.15, ge=0, lt=1)
    stiffness: float = Field(default=20.0, gt=0)
    rim_speed: tuple[float, float] = (0.3, 12.0)


class TableWheel(Definition):
    """Wheel of a gain table.

    Attributes
    ----------
    names : tuple of str
        Names of the wheels with these properties.
    radius, inertia : float
        m and kg*m^2, above 0.
    load : float
        Static load, N, above 0.
    """

    names: tuple[str, ...]
    radius: float = Field(gt=0)
    inertia: float = Field(gt=0)
    load: float = Field(gt=0)


class TableFile(Definition):
    """Content of a gain table file.

    Attributes
    ----------
    format : str
        `FORMAT`.
    vehicle : str
        Name of the vehicle, for information.
    wheels : tuple of TableWheel
        Wheels of the vehicle.
    scheduling : Scheduling
        Conversion to slip pole and torque scale.
    certificate : Certificate
        Gains and proof.
    digest : str
        SHA-256 of the other fields, hexadecimal.
    """

    format: Literal['traction gain table 1']
    vehicle: str
    wheels: tuple[TableWheel, ...] = Field(min_length=1)
    scheduling: Scheduling
    certificate: Certificate
    digest: str

    def computed_digest(self) -> str:
        """Digest computed from the numbers.

        Returns
        -------
        str
            SHA-256, hexadecimal.
        """
        content = self.model_dump(mode='json', exclude={'digest'})
        text = json.dumps(content, sort_keys=True, separators=(',', ':'))
        return hashlib.sha256(text.encode()).hexdigest()


class GainTable:
    """Gains of one wheel over rim speed and slip stiffness.

    Parameters
    ----------
    wheel : TableWheel
        The wheel.
    scheduling : Scheduling
        Conversion to slip pole and torque scale.
    certificate : Certificate
        Gains and proof; not checked.

    Attributes
    ----------
    period : float
        Sampling period of the gains, s.
    """

    def __init__(
        self, wheel: TableWheel, scheduling: Scheduling, certificate: Certificate
    ) -> None:
        design = certificate.design
        self.period = design.period
        turning = Wheel(radius=wheel.radius, width=1.0, inertia=wheel.inertia)
        self._scale = torque_scale(turning, 1.0, scheduling.slip)
        self._pole = slip_pole(turning, 1.0, 1.0, scheduling.slip)
        self._slowest = scheduling.rim_speed[0]
        self._most = scheduling.stiffness * wheel.load
        # Plain numbers are faster than arrays for one set of gains at a time.
        self._per_step = 1.0 / design.step
        self._last = design.grid - 1
        self._gains = [tuple(row) for row in certificate.gains]

    def at(self, rim_speed: float, stiffness: float) -> tuple[float, ...]:
        """Interpolate the gains; outside the table the values at its edge.

        Parameters
        ----------
        rim_speed : float
            r*omega, m/s; only its magnitude matters.
        stiffness : float
            Slip stiffness, N; negative values count as 0.

        Returns
        -------
        tuple of float
            Gain on slip error, N·m; gains on shaft torque and on the commands sent 1, 2, ...
            periods ago, all less the moment of the soil, 1.
        """
        speed = max(abs(rim_speed), self._slowest)
        # NaN becomes 0, which has the smallest gains.
        stiffness = min(stiffness, self._most) if stiffness > 0.0 else 0.0
        place = math.log1p(stiffness * self._pole / speed) * self._per_step
        place = min(place, self._last)
        row = min(int(place), self._last - 1)
        share = place - row
        gains = [
            low + share * (high - low)
            for low, high in zip(self._gains[row], self._gains[row + 1], strict=True)
        ]
        gains[0] *= speed * self._scale
        return tuple(gains)


def table_wheels(vehicle: Vehicle) -> tuple[TableWheel, ...]:
    """Wheels of a vehicle, equal ones grouped.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.

    Returns
    -------
    tuple of TableWheel
        In order of first occurrence, SI units.
    """
    found: dict[tuple[float, float, float], list[str]] = {}
    for name, wheel, load in zip(
        vehicle.wheel_names, vehicle.wheels, vehicle.static_loads(), strict=True
    ):
        # Loads of equal wheels differ by rounding.
        found.setdefault((wheel.radius, wheel.inertia, round(float(load), 6)), []).append(name)
    return tuple(
        TableWheel(names=tuple(names), radius=radius, inertia=inertia, load=load)
        for (radius, inertia, load), names in found.items()
    )


def largest_pole(wheels: Iterable[TableWheel], scheduling: Scheduling) -> float:
    """Largest slip pole of wheels: at the largest stiffness and the smallest rim speed.

    Parameters
    ----------
    wheels : iterable of TableWheel
        The wheels.
    scheduling : Scheduling
        Ranges of stiffness and rim speed.

    Returns
    -------
    float
        1/s.
    """
    return max(
        slip_pole(
            Wheel(radius=wheel.radius, width=1.0, inertia=wheel.inertia),
            scheduling.rim_speed[0], scheduling.stiffness * wheel.load, scheduling.slip,
        )
        for wheel in wheels
    )  # fmt: skip


def write_gain_table(
    path: Path | str,
    name: str,
    wheels: tuple[TableWheel, ...],
    scheduling: Scheduling,
    certificate: Certificate,
) -> None:
    """Write a gain table.

    Parameters
    ----------
    path : Path or str
        YAML file to write.
    name : str
        Name of the vehicle, for information.
    wheels : tuple of TableWheel
        Its wheels, SI units.
    scheduling : Scheduling
        Conversion to slip pole and torque scale.
    certificate : Certificate
        Gains and proof.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    unsigned = TableFile(
        format=FORMAT, vehicle=name, wheels=wheels, scheduling=scheduling,
        certificate=certificate, digest='',
    )  # fmt: skip
    content = unsigned.model_dump(mode='json')
    content['digest'] = unsigned.computed_digest()
    design = certificate.design
    worst = max(certificate.performance)
    text = (
        f'# Gains of slip control for {name}, made by `traction synthesize`: see '
        f'docs/theory.md, "LPV synthesis".\n'
        f'# {design.kind}, {"gamma" if design.kind == "hinf" else "cost"} at most {worst:.4g}; '
        f'period {design.period:g} s, delay {design.delays[0]} to {design.delays[1]} periods, '
        f'lag {design.lags[0]:g} to {design.lags[1]:g} s,\n'
        f'# stiffness misjudged up to {design.stiffness_error:g} times. '
        'Changed by hand it is refused: the certificate is checked whenever it is read.\n'
    )
    # Lists of numbers on one line; floats with all digits.
    text += yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120)
    Path(path).write_text(text, encoding='utf-8')


def read_table_file(path: Path | str, density: int = 1) -> tuple[TableFile, Margins]:
    """Read a gain table and check its certificate.

    Parameters
    ----------
    path : Path or str
        YAML file.
    density : int
        Density of the check, as a multiple of the grid of the synthesis.

    Returns
    -------
    TableFile
        Content of the file.
    Margins
        Result of the check, dimensionless.

    Raises
    ------
    DefinitionError
        If the file is missing or not laid out like a gain table, naming the key.
    GainTableError
        If the numbers were changed or the certificate does not hold.
    """
    path = Path(path)
    content: TableFile = build(TableFile, read_yaml(path), str(path))
    try:
        found = check(content.certificate, density)
    except CertificateError as error:
        raise GainTableError(f'{path}: {error}') from error
    largest = largest_pole(content.wheels, content.scheduling)
    covered = content.certificate.design.largest_pole
    if largest > covered * (1 + 1e-9):
        raise GainTableError(
            f'{path}: the certificate covers slip poles up to {covered:.4g} 1/s, its wheels have '
            f'up to {largest:.4g}'
        )
    if content.digest != content.computed_digest():
        raise GainTableError(
            f'{path}: the digest does not fit the numbers: the file was changed by hand; make '
            'it again with `traction synthesize`'
        )
    return content, found


def find_gain_table(name: str, vehicle: str) -> Path | None:
    """Find the file of a gain table.

    Parameters
    ----------
    name : str
        Path of a YAML file, or name of a shipped table; empty: the table of the vehicle.
    vehicle : str
        Name of the vehicle.

    Returns
    -------
    Path or None
        The file; None if `name` is empty and no table is shipped for the vehicle.

    Raises
    ------
    ValueError
        If no table of that name is shipped.
    """
    if Path(name).suffix in ('.yaml', '.yml'):
        return Path(name)
    folder = Path(get_package_share_directory('traction_controller'), 'config', 'gains')
    shipped = {path.stem: path for path in folder.glob('*.yaml')}
    if name and name not in shipped:
        raise ValueError(
            f"unknown gain table '{name}'{closest(name, shipped)}; or give the path of a .yaml"
        )
    return shipped.get(name or vehicle)


def read_gain_table(
    path: Path | str, vehicle: Vehicle | None = None, period: float | None = None
) -> dict[str, GainTable]:
    """Read a gain table and check its certificate.

    Parameters
    ----------
    path : Path or str
        YAML file, made by `traction synthesize`.
    vehicle : Vehicle, optional
        Vehicle to control; it must match the table.
    period : float, optional
        Sampling period of the controller, s; it must match the table.

    Returns
    -------
    dict of str to GainTable
        Gain tables by name of wheel; gains in N·m and 1.

    Raises
    ------
    DefinitionError
        If the file is missing or not laid out like a gain table, naming the key.
    GainTableError
        If its numbers were changed, the certificate does not hold, or it is for another
        vehicle or period.
    """
    content, _ = read_table_file(path)
    design = content.certificate.design
    if period is not None and not math.isclose(period, design.period, rel_tol=1e-6):
        raise GainTableError(
            f'{path}: made for a period of {design.period:g} s, the controller has {period:g} s'
        )
    if vehicle is not None:
        _check_wheels(path, content, vehicle)
    return {
        name: GainTable(wheel, content.scheduling, content.certificate)
        for wheel in content.wheels
        for name in wheel.names
    }


def _check_wheels(path: Path | str, content: TableFile, vehicle: Vehicle) -> None:
    """Raise GainTableError if the table is for another vehicle."""
    made_for = {name: wheel for wheel in content.wheels for name in wheel.names}
    needed = {name: wheel for wheel in table_wheels(vehicle) for name in wheel.names}
    if set(made_for) != set(needed):
        raise GainTableError(
            f'{path}: made for the wheels {", ".join(made_for)} of {content.vehicle}, the '
            f'vehicle has {", ".join(needed)}'
        )
    for name, wheel in needed.items():
        for what in ('radius', 'inertia', 'load'):
            given, wanted = getattr(made_for[name], what), getattr(wheel, what)
            if not math.isclose(given, wanted, rel_tol=1e-6):
                raise GainTableError(
                    f"{path}: made for a wheel '{name}' of {what} {given:g}, the vehicle's has "
                    f'{wanted:g}: make a table for it with `traction synthesize`'
                )
