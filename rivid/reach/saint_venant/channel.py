"""The channel: sections along the reach, cell by cell."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rivid.core.hydraulics import GRAVITY
from rivid.errors import ConfigError
from rivid.types import Floats

MIN_CELLS = 4
MAX_CELLS = 2048
"""Most cells of a simulated channel: the loops' buffer has this size."""
COURANT_LIMIT = 0.6
"""Largest Courant number (|v| + sqrt(g A / B)) dt / dx of a time step. Without friction, small waves of the
scheme grow beyond 0.63 at a Froude number of 0.02 to 0.2, 0.61 at 0.6, 0.59 at 0.8 (its linear stability)."""


@dataclass(frozen=True, eq=False)
class Channel:
    """A reach cut into equal cells, each with a rectangular or trapezoidal section; arrays of shape (cells,).

    ConfigError, which names the value, where one is impossible.
    """

    length: float  # L [m], from the upstream dam to the downstream one, where the gauge stands
    bed: Floats  # level of the bed at the middle of each cell [m], above the gauge's datum
    bottom_width: Floats  # [m]
    side_slope: Floats  # run of the banks for each metre up [-]; 0 is a rectangle
    manning: Floats  # Manning's n [s/m^(1/3)]
    # relative change of the surface's width for each metre above `area_reference` [1/m], on top of what the
    # banks do; for levels near it [m], with the wetted perimeter left as it is
    area_slope: float = 0.0
    area_reference: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.length) and self.length > 0):
            raise ConfigError(f"length = {self.length} m: expected a positive number")
        cells = np.size(self.bed)
        if cells < MIN_CELLS:
            raise ConfigError(f"bed has {cells} cells: expected {MIN_CELLS} or more")
        for name, least, wanted in (
            ("bed", -np.inf, "a finite level [m]"),
            ("bottom_width", np.nextafter(0.0, 1.0), "more than 0 m"),
            ("side_slope", 0.0, "0 or more"),
            ("manning", 0.0, "0 or more"),
        ):
            values = np.array(getattr(self, name), float)
            if values.shape != (cells,):
                raise ConfigError(f"{name} has shape {values.shape}: expected ({cells},), one for each cell")
            wrong = ~np.isfinite(values) | (values < least)
            if wrong.any():
                cell = int(np.argmax(wrong))
                raise ConfigError(f"{name} = {values[cell]} in cell {cell}: expected {wanted}")
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    @classmethod
    def smooth(
        cls, length: float, width: float, slope: float, manning: float, cells: int, *,
        side_slope: float = 0.0, end_bed: float = 0.0, width_modes: Sequence[float] = (),
        bed_modes: Sequence[float] = (), manning_modes: Sequence[float] = (),
    ) -> "Channel":  # fmt: skip
        """A channel from a few numbers: means, and smooth modes ``cos(j pi x / L)``, j = 1, 2, ...

        The bed falls by `slope` [-] to the level `end_bed` [m] at x = L. `width_modes` and `manning_modes`
        are amplitudes of the logarithms of the width and of Manning's n [-], `bed_modes` of the bed's level
        about its slope [m]; without any, the section is the same everywhere.

        Examples
        --------
        >>> Channel.smooth(8000.0, 80.0, 1e-4, 0.03, 4).bed.round(3).tolist()
        [0.7, 0.5, 0.3, 0.1]
        """
        if not (np.isfinite(width) and width > 0):
            raise ConfigError(f"width = {width} m: expected a positive number")
        if cells < MIN_CELLS:
            raise ConfigError(f"cells = {cells}: expected {MIN_CELLS} or more")
        x = (np.arange(cells) + 0.5) / cells

        def wave(modes: Sequence[float]) -> Floats:
            numbers = np.arange(1, len(modes) + 1)
            return np.asarray(np.cos(np.pi * np.outer(x, numbers)) @ np.asarray(modes, float), float)

        shape = np.exp(wave(width_modes))
        return cls(
            length=length,
            bed=end_bed + slope * length * (1.0 - x) + wave(bed_modes),
            bottom_width=width / float(shape.mean()) * shape,
            side_slope=np.full(cells, side_slope),
            manning=manning * np.exp(wave(manning_modes)),
        )

    def with_area_slope(self, slope: float, level: float) -> "Channel":
        """The same channel with a surface that changes by a share of `slope` for each metre about `level`."""
        return replace(self, area_slope=slope, area_reference=level) if slope else self

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.bed)

    @property
    def dx(self) -> float:
        """Length of a cell [m]."""
        return self.length / self.cells

    @property
    def x(self) -> Floats:
        """Middles of the cells [m] from the upstream dam, shape (cells,)."""
        return np.asarray((np.arange(self.cells) + 0.5) * self.dx, float)

    @cached_property
    def sections(self) -> "Sections":
        """The sections as the loops take them."""
        b, s = self.bottom_width, self.side_slope
        depth = self.area_reference - self.bed
        bend = self.area_slope * (b + 2.0 * s * depth)
        if bend.any() and not (depth > 0).all():
            raise ConfigError(
                f"area_reference = {self.area_reference:g} m: expected a level above the bed everywhere"
            )
        squares = self.manning**2
        friction = np.asarray(GRAVITY * np.pad(0.5 * (squares[:-1] + squares[1:]), 1))
        areas = 0.5 * bend * depth**2, b - bend * depth, s + 0.5 * bend
        return Sections(self.bed, *areas, p=b, w=2.0 * np.sqrt(1.0 + s * s), friction=friction)

    def area(self, level: ArrayLike) -> Floats:
        """Wetted area A of each cell's section [m2] at a level [m]; shapes (..., cells)."""
        c = self.sections
        depth = np.asarray(level, float) - self.bed
        return np.asarray(c.a + (c.b + c.s * depth) * depth)

    def level(self, area: ArrayLike) -> Floats:
        """Level [m] of each cell for a wetted area [m2]; shapes (..., cells). Inverse of :meth:`area`."""
        c = self.sections
        a = np.asarray(area, float) - c.a
        return np.asarray(self.bed + 2.0 * a / (c.b + np.sqrt(c.b * c.b + 4.0 * c.s * a)))

    def width(self, level: ArrayLike) -> Floats:
        """Width B of each cell's surface [m] at a level [m]; shapes (..., cells)."""
        c = self.sections
        return np.asarray(c.b + 2.0 * c.s * (np.asarray(level, float) - self.bed))

    def surface_area(self, level: ArrayLike) -> float:
        """Water surface of the whole reach [m2] at levels [m] that are one, or one for each cell."""
        return float(np.sum(self.width(level)) * self.dx)


class Sections(NamedTuple):
    """Sections as polynomials of the depth h, arrays of shape (cells,).

    ``A = a + b h + s h^2``, surface width ``B = b + 2 s h``, wetted perimeter ``P = p + w h``; and
    `friction`, g n^2 on the faces, the ends left at zero, shape (cells + 1,).
    """

    bed: Floats
    a: Floats
    b: Floats
    s: Floats
    p: Floats
    w: Floats
    friction: Floats
