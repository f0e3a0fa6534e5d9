"""`[jmap]`, `[search]`, `[cusum]` and `[posterior]` of the configuration: what the estimators work with."""

from collections.abc import Callable
from typing import Annotated, Literal, TypeVar

from pydantic import Field

from rivid.core.posterior.settings import PosteriorSettings, RiverSettings, lags_of
from rivid.core.settings import DEFAULT_ALPHA, CusumSettings, JmapSettings, Moment, SearchSettings
from rivid.errors import ConfigError
from rivid.input_config import Means, Section

T = TypeVar("T")

MAX_ORDER = 1000
"""Longest FIR [samples]."""

Order = Annotated[int, Field(ge=6, le=MAX_ORDER)]
Alpha = Annotated[float, Field(ge=1e-9, le=1e14)]
Delay = Annotated[int, Field(ge=1, le=MAX_ORDER)]
Temperature = Annotated[float, Field(ge=1, le=1e6)]
Share = Annotated[float, Field(ge=0, le=1)]
Part = Annotated[float, Field(ge=0, lt=1)]
Spread = Annotated[float, Field(gt=0, le=100)]
"""Of a front's place [samples]."""


class JmapConfig(Section):
    """`[jmap]`: the settings of :class:`rivid.core.settings.JmapSettings`, with the paper's names."""

    order: Annotated[
        Order | Literal["bounds"],
        Means("samples", "M, length of the FIR; `bounds`: from the hydraulics of `[reach]`"),
    ] = JmapSettings.order
    d_min: Annotated[int, Field(ge=1)] = JmapSettings.d_min
    d_max: Annotated[
        Annotated[int, Field(ge=1)] | Literal["bounds"],
        Means("samples", "longest delay tried; `bounds`: from the hydraulics of `[reach]`"),
    ] = JmapSettings.d_max
    sigma_d: Annotated[
        Annotated[float, Field(ge=0.1, le=1e4)] | Literal["bounds"],
        Means(
            "samples", "scale and mode of the Rayleigh prior (26); `bounds`: from the hydraulics of `[reach]`"
        ),
    ] = JmapSettings.delay_scale
    alpha: Annotated[
        Alpha, Means("(m3/s)^2", "fixed regularisation weight of `map` and `jmap-uniform` (22), Table V")
    ] = DEFAULT_ALPHA
    d_init: Annotated[int, Field(ge=1)] = JmapSettings.d_init
    tolerance: Annotated[float, Field(ge=1e-9, lt=1)] = JmapSettings.tolerance
    max_iterations: Annotated[int, Field(ge=2, le=10_000)] = JmapSettings.max_iterations
    start: Annotated[
        Literal["rest", "free"] | None,
        Means(
            "-",
            "before the first sample: at `rest` (the paper; a pool), or `free` (a river)",
        ),
    ] = None


class SearchConfig(Section):
    """`[search]`: the delays that direct and indirect (Table IV) try; those of `[jmap]` where not given."""

    d_min: Annotated[
        Delay | None, Means("samples", "shortest delay tried; that of `[jmap]` where not given")
    ] = None
    d_max: Annotated[
        Delay | None, Means("samples", "longest delay tried; that of `[jmap]` where not given")
    ] = None

    def settings(self, jmap: JmapSettings) -> SearchSettings:
        """The core's settings.

        Raises
        ------
        ConfigError
            For delays in the wrong order.
        """
        d_min = jmap.d_min if self.d_min is None else self.d_min
        d_max = jmap.d_max if self.d_max is None else self.d_max
        return _of_table("search", lambda: SearchSettings(d_min, d_max))


class CusumConfig(Section):
    """`[cusum]`: the settings of :class:`rivid.core.settings.CusumSettings`.

    The delays are those of `[jmap]` where not given; the FIR that is looked at is `[jmap]`'s.
    """

    threshold: Annotated[float, Field(gt=0, le=1e6)] = CusumSettings.threshold
    drift: Annotated[float, Field(ge=0, le=1e6)] = CusumSettings.drift
    mean_lags: Annotated[int, Field(ge=0, le=MAX_ORDER)] = CusumSettings.mean_lags
    mean: Annotated[float, Field(allow_inf_nan=False)] | None = None
    sd: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    moment: Moment = CusumSettings.moment
    d_min: Annotated[
        Delay | None,
        Means("samples", "shortest delay that can be answered; that of `[jmap]` where not given"),
    ] = None
    d_max: Annotated[
        Delay | None, Means("samples", "longest delay that can be answered; that of `[jmap]` where not given")
    ] = None

    def settings(self, jmap: JmapSettings) -> CusumSettings:
        """The core's settings.

        Raises
        ------
        ConfigError
            For delays in the wrong order, or too long for the FIR.
        """
        given = self.model_dump(exclude={"d_min", "d_max"})
        d_min = jmap.d_min if self.d_min is None else self.d_min
        d_max = jmap.d_max if self.d_max is None else self.d_max
        if d_max + 3 > jmap.order:
            raise ConfigError(
                f"[cusum] d_max = {d_max} needs an FIR of order >= {d_max + 3}, got [jmap] order = "
                f"{jmap.order}: raise order or lower d_max"
            )
        return _of_table("cusum", lambda: CusumSettings(**given, d_min=d_min, d_max=d_max))


class PosteriorConfig(Section):
    """`[posterior]`: the settings of :class:`rivid.core.posterior.settings.PosteriorSettings`.

    The delays and the length of the FIR are those of `[jmap]` where not given.
    """

    d_min: Annotated[
        Delay | None,
        Means("samples", "shortest delay that can be answered; that of `[jmap]` where not given"),
    ] = None
    d_max: Annotated[
        Delay | None, Means("samples", "longest delay that can be answered; that of `[jmap]` where not given")
    ] = None
    store_temperature: Temperature = PosteriorSettings.store_temperature
    wave_temperature: Temperature = PosteriorSettings.wave_temperature
    between_temperature: Temperature = PosteriorSettings.between_temperature
    sharp: Share = PosteriorSettings.sharp
    wave_lead: Part = PosteriorSettings.wave_lead
    wave_lag: Part = PosteriorSettings.wave_lag
    store_error: Spread = PosteriorSettings.store_error
    wave_error: Spread = PosteriorSettings.wave_error
    answer_above: Share = PosteriorSettings.answer_above

    def settings(self, jmap: JmapSettings) -> PosteriorSettings:
        """The core's settings.

        Raises
        ------
        ConfigError
            For delays in the wrong order, or too long for the FIR.
        """
        given = self.model_dump(exclude={"d_min", "d_max"})
        d_min = jmap.d_min if self.d_min is None else self.d_min
        d_max = jmap.d_max if self.d_max is None else self.d_max
        if d_max >= jmap.order:
            raise ConfigError(
                f"[posterior] d_max = {d_max} needs an FIR of order >= {d_max + 1}, got [jmap] order = "
                f"{jmap.order}: raise order or lower d_max"
            )
        return _of_table(
            "posterior", lambda: PosteriorSettings(**given, d_min=d_min, d_max=d_max, order=jmap.order)
        )

    def river_settings(self, jmap: JmapSettings, day: float) -> RiverSettings:
        """The core's settings of a river whose day has so many samples; of this table the delays alone count.

        Raises
        ------
        ConfigError
            For delays in the wrong order.
        """
        d_min = jmap.d_min if self.d_min is None else self.d_min
        d_max = jmap.d_max if self.d_max is None else self.d_max
        return _of_table(
            "posterior",
            lambda: RiverSettings(d_min=d_min, d_max=d_max, warm=lags_of(d_max), day=max(round(day), 1)),
        )


def _of_table(table: str, make: Callable[[], T]) -> T:
    """Settings of a table, whose faults name it."""
    try:
        return make()
    except ConfigError as error:
        raise ConfigError(f"[{table}] {error}") from None
