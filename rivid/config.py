"""The configuration: pydantic models of the tables of a TOML file, and how it is read.

An error is one line: the file, the key, what came and what is valid. Defaults and limits of the estimators
are those of :mod:`rivid.core.settings`; the defaults of the reach are Table I.
"""

import math
import re
import tomllib
from copy import deepcopy
from dataclasses import fields
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import pydantic
from pydantic import BaseModel, Field, ValidationError, ValidationInfo, field_validator, model_validator

from rivid.core import settings as core
from rivid.core.settings import CusumSettings, JmapSettings, PosteriorSettings, RiverSettings, SearchSettings
from rivid.errors import ConfigError, nearest
from rivid.estimators import ESTIMATORS
from rivid.input_config import FLOWS, InputConfig, Means, Section

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rivid.core.hydraulics import DelayProposal, TravelBounds
    from rivid.types import Floats

T = TypeVar("T", bound=BaseModel)
S = TypeVar("S", SearchSettings, CusumSettings, PosteriorSettings, RiverSettings)
NAME = r"^[A-Za-z0-9_-][A-Za-z0-9._-]*$"
_NAMES = ", ".join(f"`{name}`" for name in ESTIMATORS)
DAY = 86_400.0
"""Length of a day [s]; :mod:`rivid.types` imports numpy."""
Discharge = Annotated[float, Field(gt=0, le=1e7)]

_NOT_GIVEN = "; that of `[jmap]` where not given"
_BOUNDS = "`bounds`: from the hydraulics of `[reach]`"


class JmapConfig(Section):
    """`[jmap]`: the settings of :class:`rivid.core.settings.JmapSettings`, with the paper's names."""

    order: Annotated[core.Order | Literal["bounds"], Means(f"M, length of the FIR; {_BOUNDS}", "samples")] = (
        JmapSettings.order
    )
    d_min: core.Delay = JmapSettings.d_min
    d_max: Annotated[core.Delay | Literal["bounds"], Means(f"longest delay tried; {_BOUNDS}", "samples")] = (
        JmapSettings.d_max
    )
    sigma_d: Annotated[
        core.DelayScale | Literal["bounds"],
        Means(f"scale and mode of the Rayleigh prior (26); {_BOUNDS}", "samples"),
    ] = JmapSettings.delay_scale
    alpha: Annotated[
        core.Alpha, Means("fixed regularisation weight of `map` and `jmap-uniform` (22), Table V", "(m3/s)^2")
    ] = core.DEFAULT_ALPHA
    jumps: core.Jumps = JmapSettings.jumps
    alpha_h: Annotated[core.Shape | None, Means("inverse-gamma prior (32); not given: M / 2")] = None
    beta_h: Annotated[
        core.Scale | None, Means("inverse-gamma prior (32); not given: ||D h_ML||^2 / 2", "(m per m3/s)^2")
    ] = None
    alpha_w: Annotated[core.Shape, Means("the same of sigma_w^2; -1 with beta_w 0 is uniform (31)")] = (
        JmapSettings.alpha_w
    )
    beta_w: Annotated[core.Scale, Means("the same of sigma_w^2", "m^2")] = JmapSettings.beta_w
    d_init: core.Delay = JmapSettings.d_init
    tolerance: core.Tolerance = JmapSettings.tolerance
    max_iterations: core.Rounds = JmapSettings.max_iterations

    @model_validator(mode="before")
    @classmethod
    def _symbols(cls, given: Any) -> Any:
        """`M` is `order`."""
        if isinstance(given, dict) and "M" in given:
            if "order" in given:
                raise ValueError("M and order are one setting: give one of them")
            given = {"order": given["M"]} | {key: value for key, value in given.items() if key != "M"}
        return given

    start: Annotated[
        Literal["rest", "free"] | None,
        Means("before the first sample: at `rest` (the paper; a pool), or `free` (a river)"),
    ] = None


class SearchConfig(Section):
    """`[search]`: the settings of :class:`rivid.core.settings.SearchSettings`.

    The delays are those of `[jmap]` where not given.
    """

    d_min: Annotated[core.Delay | None, Means(f"shortest delay tried{_NOT_GIVEN}", "samples")] = None
    d_max: Annotated[core.Delay | None, Means(f"longest delay tried{_NOT_GIVEN}", "samples")] = None


def _table_of(name: str, settings: type[CusumSettings | PosteriorSettings]) -> Any:
    """The model of a table: these settings with their limits and defaults, the FIR that of `[jmap]`."""
    text = f"`[{name}]`: the settings of :class:`rivid.core.settings.{settings.__name__}`."
    own: dict[str, Any] = {f.name: (f.type, f.default) for f in fields(settings)}
    own = {key: field for key, field in own.items() if key not in ("d_min", "d_max", "order")}
    model = f"{name.capitalize()}Config"
    return pydantic.create_model(model, __base__=SearchConfig, __module__=__name__, __doc__=text, **own)


if TYPE_CHECKING:
    CusumConfig = SearchConfig
    PosteriorConfig = SearchConfig
else:
    CusumConfig = _table_of("cusum", CusumSettings)
    PosteriorConfig = _table_of("posterior", PosteriorSettings)


class ReachConfig(Section):
    """`[reach]`: the reach and its geometry (Table I)."""

    name: Annotated[str, Means("its name, in tables and titles: letters, digits, `.`, `_`, `-`")] = Field(
        "reach", pattern=NAME, max_length=80
    )
    note: Annotated[
        str, Means("a line about the data, under the titles of reports"), Field(max_length=200)
    ] = ""
    kind: Annotated[
        Literal["pool", "river"],
        Means("`pool`: the output is the level at a dam; `river`: it is the discharge at the lower end"),
    ] = "pool"
    length: Annotated[float, Field(gt=0, le=1e7), Means("from dam to dam, along the water", "m")] = 8200.0
    width: Annotated[float, Field(gt=0, le=1e6), Means("mean width", "m")] = 81.6
    depth: Annotated[float, Field(gt=0, le=1e4), Means("mean depth", "m")] = 4.9
    bed_level: Annotated[
        float | None,
        Means("bed at the downstream dam; the depth is then the level less this, day by day", "m"),
    ] = Field(None, allow_inf_nan=False)
    surface_area: Annotated[float, Field(gt=0, le=1e12), Means("surface of the water", "m2")] = 6.7e5
    discharge_range: Annotated[
        tuple[Discharge, Discharge],
        Means("lowest and highest usual discharge: the bounds are worked out from it", "m3/s"),
    ] = (100.0, 800.0)
    sample_time: Annotated[
        float,
        Field(ge=0.01, le=86_400, allow_inf_nan=False),
        Means("T_s: logs are put on a grid of this step; flows that come more often are averaged", "s"),
    ] = 133.0

    @model_validator(mode="after")
    def _ordered(self) -> "ReachConfig":
        low, high = self.discharge_range
        if low > high:
            raise ValueError(f"discharge_range = [{low}, {high}]: expected lowest, highest [m3/s]")
        return self

    def depth_at(self, level: "ArrayLike | None" = None) -> "Floats":
        """Return z* of (6) [m]: `level` [m] less `bed_level` where both are known, else `depth`."""
        import numpy as np

        if level is None or self.bed_level is None:
            return np.array(self.depth)
        above = np.asarray(level, float) - self.bed_level
        return np.where(above > 0, above, self.depth)

    def bounds(self, discharge: "ArrayLike", level: "ArrayLike | None" = None) -> "TravelBounds":
        """Return Froude number and bounds (4)-(6) at mean discharges [m3/s] and mean levels [m]."""
        from rivid.core.hydraulics import travel_bounds

        return travel_bounds(discharge, length=self.length, width=self.width, depth=self.depth_at(level))

    @property
    def waves(self) -> tuple[float, float] | None:
        """Shortest and longest travel time of a wave that carries the signal, over discharge_range [s].

        The gravity wave carries it in a pool; in a river all waves up to the kinematic one do. None where the
        geometry is not configured.
        """
        if not {"length", "width", "depth"} <= self.model_fields_set:
            return None
        bounds = self.bounds(self.discharge_range)
        slowest = bounds.gravity if self.kind == "pool" else bounds.kinematic
        return float(bounds.gravity.min()), float(slowest.max())

    def proposal(self, sample_time: float | None = None) -> "DelayProposal":
        """Candidate delays from the hydraulics, at another `sample_time` [s] where given."""
        from rivid.core.hydraulics import propose_delays

        return propose_delays(
            self.discharge_range, length=self.length, width=self.width, depth=self.depth,
            sample_time=sample_time or self.sample_time, kind=self.kind,
        )  # fmt: skip

    @property
    def output(self) -> str:
        """Canonical column that the estimators explain: the level, or a river's discharge."""
        return "h_L" if self.kind == "pool" else "Q_L"

    @property
    def output_unit(self) -> str:
        """Unit of the output."""
        return "m" if self.kind == "pool" else "m3/s"


MOST_DAYS = 31
"""Most days of a data set: it has one delay, which does not hold for seasons."""


class RunConfig(Section):
    """`[run]`: which estimators, on data sets of how many days."""

    estimators: Annotated[list[str], Means(f"names of estimators; a day has a row for each: {_NAMES}")] = (
        Field(["jmap", "posterior"], min_length=1)
    )
    window_days: Annotated[
        int, Field(ge=1, le=MOST_DAYS), Means("length of a data set; it is dated by its last day", "days")
    ] = 1
    window: Annotated[
        Annotated[str, Field(pattern=r"^\d+(\.\d+)? ?(s|min|h)$")] | None,
        Means(
            "length of data sets shorter than a day, as `75 s`, `10 min`, `6 h`: a day's log is cut into "
            "these from its first row, and again after each pause. Tables have a column `start`, their "
            "local begin; there are no figures and no report"
        ),
    ] = None
    min_motion: Annotated[
        float,
        Field(ge=0, le=1),
        Means("an inflow that moves by less than this share of its largest value counts as still"),
    ] = 1e-4
    # not part of as_used(): the command line reads it, and no result depends on it
    out: Annotated[
        Annotated[str, Field(max_length=4096)] | None,
        Means("directory of the results, relative to the configuration; `--out` goes over it"),
    ] = Field(None, exclude=True)

    @property
    def window_s(self) -> float:
        """Length of a data set shorter than a day [s]; 0 for whole days."""
        number, unit = re.fullmatch(r"([\d.]+) ?(\w*)", self.window or "0").groups()  # type: ignore[union-attr]
        return float(number) * {"min": 60.0, "h": 3600.0}.get(unit, 1.0)

    def lengthen(self, seconds: float) -> str:
        """Advice for messages: the settings for data sets of this length [s] or longer."""
        if self.window and seconds <= DAY / 2:
            return f'set [run] window = "{math.ceil(seconds)} s" or longer'
        days = f"set [run] window_days = {math.ceil(seconds / DAY)} or more"
        return f"{days}, without window" if self.window else days

    @model_validator(mode="after")
    def _one_length(self) -> "RunConfig":
        if self.window and not (0 < self.window_s <= DAY / 2 and self.window_days == 1):
            raise ValueError(
                f'window = "{self.window}" and window_days = {self.window_days}: expected a window of half a '
                "day or less, or window_days"
            )
        return self

    @field_validator("estimators")
    @classmethod
    def _known_estimators(cls, value: list[str]) -> list[str]:
        for name in value:
            if name not in ESTIMATORS:
                raise ValueError(
                    f"{name!r} is not an estimator; valid: {', '.join(ESTIMATORS)}{nearest(name, ESTIMATORS)}"
                )
        return list(dict.fromkeys(value))

    @field_validator("out")
    @classmethod
    def _is_a_path(cls, value: str | None) -> str | None:
        if value is not None and (not value.strip() or "\0" in value):
            raise ValueError("expected the path of a directory, relative to this file")
        return value


class DiagnoseConfig(Section):
    """`[diagnose]`: what a diagnosis may look for, and what is known of the channel."""

    slope: Annotated[
        Annotated[float, Field(ge=0, le=0.05)] | None,
        Means("fall of the bed; not given: 0.15 depths over the reach; it is fitted in any case"),
    ] = None
    manning: Annotated[
        float, Field(ge=0.005, le=0.2), Means("Manning's n that the fit starts from", "s/m^(1/3)")
    ] = 0.03
    gauge_step: Annotated[
        Annotated[float, Field(ge=0, le=1e4)] | None,
        Means("what the gauge rounds to; not given: seen from the record", "m or m3/s"),
    ] = None
    exclude: Annotated[list[str], Means("effects that are not to be looked for")] = []
    effects_file: Annotated[
        Path | None, Means("a Python file with own effects, relative to the configuration")
    ] = None
    most_effects: Annotated[int, Field(ge=1, le=10), Means("no more effects than this are added")] = 4


class Config(Section):
    """All of a run's configuration."""

    reach: ReachConfig = ReachConfig()
    input: InputConfig = InputConfig()
    run: RunConfig = RunConfig()
    jmap: JmapConfig = JmapConfig()
    search: SearchConfig = SearchConfig()
    cusum: CusumConfig = CusumConfig()
    posterior: PosteriorConfig = PosteriorConfig()
    diagnose: DiagnoseConfig = DiagnoseConfig()

    @field_validator("input")
    @classmethod
    def _columns_of_one_role(cls, value: InputConfig, info: ValidationInfo) -> InputConfig:
        reach = info.data.get("reach")
        if reach is None:
            return value  # its own error is raised
        roles = ("time", "u_Qi", "u_Qo", "h_L") if reach.kind == "pool" else ("time", "u_Qi", "Q_L")
        named = {role: columns for role in roles if (columns := getattr(value, role)) != ""}
        given = {role: set(c) if isinstance(c, list) else {c or role} for role, c in named.items()}
        for one, other in combinations(given, 2):
            shared = given[one] & given[other]
            # two discharges may share a part, such as a bypass; nothing else may
            if shared and (given[one] == given[other] or not {one, other} <= set(FLOWS)):
                raise ValueError(
                    f"column {min(shared)!r} stands for {one} and for {other}: expected different columns"
                )
        return value

    @model_validator(mode="after")
    def _what_estimators_need(self) -> "Config":
        for name in self.run.estimators:
            if self.reach.kind not in ESTIMATORS[name].reaches:
                raise ValueError(
                    f"[run] estimators has {name}, which has no equations for [reach] "
                    f'kind = "{self.reach.kind}": leave it out'
                )
            if ESTIMATORS[name].needs_outflow and not self.input.u_Qo:
                raise ValueError(
                    f'[run] estimators has {name}, which needs the outflow; [input] u_Qo = "" marks it '
                    f"as not logged: leave {name} out, or name the column"
                )
        return self

    def as_used(self) -> dict[str, Any]:
        """The configuration as JSON can hold it, without the tables of unused estimators.

        A change of an unused table then leaves finished days valid.
        """
        tables = {ESTIMATORS[name].table for name in self.run.estimators}
        unused = {one.table for one in ESTIMATORS.values()} - tables - {"jmap"}
        used = self.model_dump(mode="json", exclude=unused)
        if self.run.window is None:  # results of earlier versions stay valid
            del used["run"]["window"]
        return used

    def search_settings(self) -> SearchSettings:
        """The core's settings of `direct` and `indirect`; raises ConfigError as :meth:`jmap_settings`."""
        return self._settings("search", SearchSettings)

    def cusum_settings(self) -> CusumSettings:
        """The core's settings of CUSUM; raises ConfigError as :meth:`jmap_settings`."""
        return self._settings("cusum", CusumSettings, beyond=3)

    def posterior_settings(self) -> PosteriorSettings:
        """The core's settings of `posterior`; raises ConfigError as :meth:`jmap_settings`."""
        order = self.jmap_settings().order
        return self._settings("posterior", PosteriorSettings, beyond=1, order=order)

    def river_settings(self) -> RiverSettings:
        """The core's settings of `posterior` on a river; raises ConfigError as :meth:`jmap_settings`."""
        day = max(round((self.run.window_s or DAY) / self.reach.sample_time), 1)
        warm = core.lags_of(self.posterior.d_max or self.jmap_settings().d_max)
        return self._settings("posterior", RiverSettings, warm=warm, day=day)

    def _settings(self, table: str, kind: type[S], beyond: int | None = None, **more: int) -> S:
        """Settings of a table, its delays those of `[jmap]` where not given, and `more`.

        The FIR has to be longer than d_max by `beyond`.
        """
        jmap = self.jmap_settings()
        own = getattr(self, table).model_dump(exclude_none=True)
        given = {"d_min": jmap.d_min, "d_max": jmap.d_max} | own | more
        d_max = given["d_max"]
        if beyond is not None and d_max + beyond > jmap.order:
            raise ConfigError(
                f"[{table}] d_max = {d_max} needs an FIR of order >= {d_max + beyond}, got [jmap] order = "
                f"{jmap.order}: raise order or lower d_max"
            )
        try:
            return kind(**{field.name: given[field.name] for field in fields(kind) if field.name in given})
        except ConfigError as error:
            raise ConfigError(f"[{table}] {error}") from None

    def jmap_settings(
        self, prior: core.Prior = "rayleigh", *, fixed_alpha: bool = False, inverse_gamma: bool = True
    ) -> JmapSettings:
        """The core's settings, with "bounds" taken from the reach's hydraulics.

        ConfigError where the settings contradict each other (d_max beyond the FIR, for example).
        """
        j = self.jmap
        given: dict[str, Any] = j.model_dump(exclude={"sigma_d", "start"}) | {"delay_scale": j.sigma_d}
        if "bounds" in given.values():
            proposal = self.reach.proposal()
            given |= {key: getattr(proposal, key) for key, value in given.items() if value == "bounds"}
        if given["order"] > core.MAX_ORDER:
            raise ConfigError(
                f"the bounds of [reach] ask for an FIR of order {given['order']} at sample_time = "
                f"{self.reach.sample_time:g} s, {core.MAX_ORDER} is the most: give "
                "[jmap] order and d_max, or a longer sample_time"
            )
        unused = [] if fixed_alpha else ["alpha"]
        unused += [] if inverse_gamma else ["alpha_h", "beta_h"]
        free = self.reach.kind == "river" if j.start is None else j.start == "free"
        return JmapSettings(
            **given | dict.fromkeys(unused), prior=prior, inverse_gamma=inverse_gamma, free_start=free
        )


def load_config(path: Path | None) -> Config:
    """The configuration in a file, or the defaults (Table I, section VI) without one."""
    if path is None:
        return Config()
    return parse(read_config(path), Config, str(path))


def read_config(path: Path) -> dict[str, Any]:
    """Read the tables of a configuration, with the effects file relative to it."""
    raw = read_toml(path)
    diagnose = raw.get("diagnose")
    if isinstance(diagnose, dict) and isinstance(diagnose.get("effects_file"), str):
        diagnose["effects_file"] = str(path.parent / diagnose["effects_file"])
    return raw


def merged(shared: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Merge tables key by key into a new one; any other own value replaces the shared one."""
    both = deepcopy(shared)
    for key, value in own.items():
        mine = both.get(key)
        both[key] = merged(mine, value) if isinstance(mine, dict) and isinstance(value, dict) else value
    return both


MOST_BYTES = 1_000_000
"""Largest configuration file [bytes]; larger ones are not read."""
MOST_DEPTH = 20
"""Deepest nesting of tables and lists."""


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; ConfigError in one line where it cannot be read or is not TOML."""
    try:
        with open(path, "rb") as file:
            content = file.read(MOST_BYTES + 1)  # a device never ends
        if len(content) > MOST_BYTES:
            raise ConfigError(f"{path} is too large for a configuration (limit {MOST_BYTES:,} bytes)")
        raw = tomllib.loads(content.decode("utf-8-sig"))
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}: expected a TOML file") from None
    except (ValueError, RecursionError) as error:  # of TOML, of UTF-8, of a number of thousands of digits
        raise ConfigError(f"{path} is not valid TOML: {error}") from None
    if _is_deep(raw):  # it would exhaust the stack
        raise ConfigError(f"{path}: tables are nested more than {MOST_DEPTH} deep: expected [table] key")
    return raw


def _is_deep(value: Any, most: int = MOST_DEPTH) -> bool:
    if not isinstance(value, dict | list):
        return False
    inner = value.values() if isinstance(value, dict) else value
    return most == 0 or any(_is_deep(one, most - 1) for one in inner)


def parse(raw: dict[str, Any], model: type[T], source: str = "config") -> T:
    """Validate a nested dict; the first fault becomes a one-line :class:`ConfigError`."""
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ConfigError(f"{source}: {_explain(first, model, raw)}") from None


def _explain(fault: Any, model: type[BaseModel], raw: Any) -> str:
    where = _short(".".join(_place(fault["loc"], raw)))
    if fault["type"] == "extra_forbidden":
        fields = _fields_at(model, fault["loc"][:-1])
        return f"unknown key {where}; valid keys here: {', '.join(fields)}{nearest(fault['loc'][-1], fields)}"
    message = str(fault["msg"]).removeprefix("Value error, ")
    if (fault.get("ctx") or {}).get("pattern") == NAME:
        message = "Expected letters A to Z, digits, `.`, `_` and `-`, as of a file; `note` is any text"
    if not where:  # a fault of the whole file
        return message
    return f"{where} = {_short(repr(fault.get('input')))}: {message[:1].lower()}{message[1:]}"


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


def _place(loc: tuple[int | str, ...], raw: Any) -> list[str]:
    """The part of pydantic's path that stands in the file; the rest names types."""
    place = []
    for part in loc:
        in_list = isinstance(raw, list) and isinstance(part, int) and part < len(raw)
        if in_list or isinstance(raw, dict) and part in raw:
            raw = raw[part]
            place.append(str(part))
    return place or [str(part) for part in loc[:1]]


def _fields_at(model: type[BaseModel], loc: tuple[int | str, ...]) -> list[str]:
    for part in loc:
        field = model.model_fields.get(str(part))
        kind = field.annotation if field else None
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            model = kind
    return sorted(model.model_fields)
