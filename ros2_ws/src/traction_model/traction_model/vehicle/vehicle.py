"""Vehicle: axles, mass, geometry, and longitudinal load distribution."""

from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from traction_model.definition import Definition, DefinitionError, build, read_yaml
from traction_model.vehicle.wheel import Wheel
from traction_node.closest import closest

GRAVITY = 9.81
"""Standard acceleration used throughout, m/s^2."""

AIR_DENSITY = 1.2
"""Density of air, kg/m^3."""


class Axle(Definition):
    """Equal wheels side by side.

    Attributes
    ----------
    wheel_names : tuple of str
        Names of its wheels, from left to right, at least one.
    x : float
        Position, m ahead of the rear axle.
    wheel : Wheel
        Definition of each of its wheels.
    track_width : float
        Distance between its outer wheels, m, at least 0; 0: not known.
    """

    wheel_names: tuple[str, ...] = Field(min_length=1)
    x: float
    wheel: Wheel
    track_width: float = Field(default=0.0, ge=0)


class Vehicle(Definition):
    """Rigid vehicle with n wheels, driving straight ahead.

    Attributes
    ----------
    chassis_mass : float
        Mass without wheels, kg, above 0.
    chassis_cg_x : float
        Centre of gravity of the chassis, m ahead of the rear axle.
    chassis_cg_height : float
        Centre of gravity of the chassis, m above ground, at least 0.
    axles : tuple of Axle
        From front to rear, at least one.
    hitch_height : float
        Height of the drawbar pull, m above ground, at least 0.
    drag_area : float
        Air drag coefficient times frontal area, m^2, at least 0; drag acts at the height
        of the centre of gravity.
    """

    chassis_mass: float = Field(gt=0)
    chassis_cg_x: float
    chassis_cg_height: float = Field(ge=0)
    axles: tuple[Axle, ...] = Field(min_length=1)
    hitch_height: float = Field(default=0.0, ge=0)
    drag_area: float = Field(default=0.0, ge=0)

    @model_validator(mode='after')
    def _names_and_balance(self) -> 'Vehicle':
        names = self.wheel_names
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f'wheel name {twice[0]!r} is given twice')
        positions = [axle.x for axle in self.axles]
        if len(set(positions)) != len(positions):
            raise ValueError('two axles have the same x')
        # Overflow for masses and lengths near the largest floats.
        with np.errstate(all='ignore'):
            loads = self.static_loads()
        if not np.all(np.isfinite(loads)):
            raise ValueError('its masses and positions are too large: the wheels have no load')
        if np.any(loads <= 0):
            raise ValueError('the centre of gravity lifts a wheel at rest')
        return self

    @property
    def wheel_names(self) -> tuple[str, ...]:
        """Names of all wheels, axle by axle, left to right."""
        return tuple(name for axle in self.axles for name in axle.wheel_names)

    @property
    def wheels(self) -> tuple[Wheel, ...]:
        """Wheels in the order of `wheel_names`."""
        return tuple(axle.wheel for axle in self.axles for _ in axle.wheel_names)

    @property
    def wheel_positions(self) -> NDArray[np.float64]:
        """Position of every wheel, m ahead of the rear axle, shape (n,)."""
        return np.array([axle.x for axle in self.axles for _ in axle.wheel_names])

    @property
    def wheel_offsets(self) -> NDArray[np.float64]:
        """Position of every wheel, m to the left of the middle, shape (n,)."""
        return np.concatenate(
            [
                axle.track_width * np.linspace(0.5, -0.5, len(axle.wheel_names))
                if len(axle.wheel_names) > 1
                else np.zeros(1)
                for axle in self.axles
            ]
        )

    @property
    def mass(self) -> float:
        """Mass of chassis and wheels, kg."""
        return self.chassis_mass + sum(wheel.mass for wheel in self.wheels)

    @property
    def centre_of_gravity(self) -> tuple[float, float]:
        """Centre of gravity of chassis and wheels, m ahead of the rear axle and above ground."""
        x = self.chassis_mass * self.chassis_cg_x
        height = self.chassis_mass * self.chassis_cg_height
        for wheel, position in zip(self.wheels, self.wheel_positions, strict=True):
            x += wheel.mass * float(position)
            height += wheel.mass * wheel.radius
        return x / self.mass, height / self.mass

    def static_loads(self) -> NDArray[np.float64]:
        """Load on every wheel at rest on level ground.

        Returns
        -------
        ndarray, shape (n,)
            N, upward force of the soil on each wheel.
        """
        weight = self.mass * GRAVITY
        loads = self.load_distribution() @ np.array([weight, weight * self.centre_of_gravity[0]])
        return np.asarray(loads)

    def load_distribution(self) -> NDArray[np.float64]:
        """Shares of the wheels in total load and in its moment.

        The chassis is rigid on equal springs, so load varies linearly along the vehicle. This is
        exact for two axles and the usual assumption for more. A single axle has the whole load and
        no moment (the rig holds its pitch).

        Returns
        -------
        ndarray, shape (n, 2)
            Load of each wheel, N, per N of total load and per N·m of moment about the
            rear axle's ground contact (nose-up positive).
        """
        x = self.wheel_positions
        if len(self.axles) == 1:
            return np.column_stack([np.full(len(x), 1 / len(x)), np.zeros(len(x))])
        return np.linalg.pinv(np.vstack([np.ones_like(x), x]))

    @property
    def tracks(self) -> list[int]:
        """Index of the rut of every wheel, n entries.

        Wheels share tracks if all axles have the same number of wheels; otherwise each has its
        own.
        """
        counts = {len(axle.wheel_names) for axle in self.axles}
        if len(counts) > 1:
            return list(range(len(self.wheels)))
        return [place for axle in self.axles for place in range(len(axle.wheel_names))]

    def packed_wheels(self, in_ruts: bool = True) -> NDArray[np.float64]:
        """Packed wheels, for kernels.

        Parameters
        ----------
        in_ruts : bool
            True: wheels run in the ruts of those before them. False: undisturbed soil.

        Returns
        -------
        ndarray, shape (n, 7)
            The wheels in SI units, see `Wheel.packed`.
        """
        tracks = self.tracks if in_ruts else [-1] * len(self.wheels)
        return np.array(
            [
                wheel.packed(x, load, track)
                for wheel, x, load, track in zip(
                    self.wheels, self.wheel_positions, self.static_loads(), tracks, strict=True
                )
            ]
        )


def load_vehicle(name: str | Path, folder: str | Path = '') -> Vehicle:
    """Load a vehicle from a preset or a file.

    Parameters
    ----------
    name : str or Path
        A preset (``single_wheel_rig``, ``tractor_4wd``) or the path of a YAML file of the same
        format, in SI units.
    folder : str or Path
        Folder of the file; default: the current one.

    Returns
    -------
    Vehicle
        The vehicle, in SI units.

    Raises
    ------
    DefinitionError
        If it is invalid; the text has file and key, or the nearest preset.
    """
    presets = {path.stem: path for path in _preset_folder().glob('*.yaml')}
    path = presets.get(str(name), Path(folder, name))
    if path.suffix not in ('.yaml', '.yml'):
        raise DefinitionError(f"unknown vehicle '{name}'{closest(str(name), presets)}")
    return build(Vehicle, read_yaml(path), str(path))


def _preset_folder() -> Path:
    return Path(str(files('traction_model') / 'presets' / 'vehicles'))
