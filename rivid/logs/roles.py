"""Which column, or tag, is which canonical one: by name and site, and asked where these do not tell."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from rivid.logs.guess import ColumnGuess
from rivid.logs.proposal import Questions

Group = list[ColumnGuess]
MOST = 6
"""Other choices that are shown."""
_BREAK = re.compile(r"[\s._:/\\|-]+")
_NO_SITE = re.compile(
    r"(q|h|w|z|flows?|discharge|in|out|inflow|outflow|level|stage|elev\w*|debit|débit|niveau|cote|hauteur|pegel"
    r"|wasserstand|durchfluss|zufluss|abfluss|caudal|nivel|portata|livello|total|sum|mean|avg"
    r"|(u|g|t|unit|units|groupe|turbines?|gates?|spill\w*|vannes?|tor|wehr|release)\d*)"
)
"""First words of names that tell a quantity or a machine, not a place."""
_TOTAL = re.compile(r"(?<![a-z])(total|sum|gesamt|summe|somme|suma|totale)(?![a-z])")
_TAILWATER = re.compile(r"tail|unterwasser|(?<![a-z])[ut]w(?![a-z])|down|aval|abajo")


@dataclass
class Roles:
    """Which column is which.

    Attributes
    ----------
    groups : dict of list of ColumnGuess
        By canonical column; several of one are summed.
    kind : {"pool", "river"}
    instead : dict of list
        By canonical column: what else it may be, as `groups`.
    """

    groups: dict[str, Group]
    kind: str
    instead: dict[str, list[Group]] = field(default_factory=dict)


def roles_of(columns: list[ColumnGuess], questions: Questions) -> Roles:
    """Which column is which; several columns of one site that leave or enter the reach are summed.

    Parameters
    ----------
    columns : list of ColumnGuess
    questions : Questions
        Gets what names do not tell.
    """
    flows = [c for c in columns if c.role in ("u_Qi", "u_Qo", "flow")]
    levels = [c for c in columns if c.role == "h_L"]
    if not levels:
        return _river(flows, questions)
    level = next((c for c in levels if not _TAILWATER.search(c.name.lower())), levels[0])
    instead: dict[str, list[Group]] = {}
    if len(levels) > 1:
        names = ", ".join(c.name for c in levels)
        questions.ask("h_L", f"h_L: which of {names} is the level at the downstream dam?")
        instead["h_L"] = [[c] for c in levels if c is not level]
    sites = _sites([*flows, level])
    ins, outs, why = _by_site(flows, level, sites) or _by_name(flows, sites)
    if not ins:
        questions.ask("u_Qi", "no column is called like an inflow: set u_Qi")
    elif len(flows) > 1 or not ins[0].sure:
        _ask_which(ins, outs, flows, why, questions)
        if not _unmistakable(ins, outs, flows):
            instead |= _others(ins, outs, flows, sites)
    groups = {"h_L": [level], "u_Qi": ins, "u_Qo": outs}
    return Roles({role: group for role, group in groups.items() if group}, "pool", instead)


def _river(flows: Group, questions: Questions) -> Roles:
    named = [c for c in flows if c.role == "u_Qi"]
    rest = [c for kind in ("flow", "u_Qo") for c in flows if c.role == kind]
    order = [*named[:1], *rest, *named[1:]]  # what is not called an inflow is rather the output
    ins, outs = order[:1], order[1:2]
    instead = {}
    if not ins:
        questions.ask("u_Qi", "no column is called like an inflow: set u_Qi")
    if not outs:
        questions.ask(
            "h_L", "no column is called like a level or a second discharge: set h_L, or Q_L of a river"
        )
    elif not _unmistakable(ins, outs, flows):
        many = "more than two discharges" if len(order) > 2 else "two discharges"
        questions.ask("u_Qi", f"{many} and no level: which is the inflow, which the output?")
        instead = {
            "u_Qi": _distinct([[c] for c in order], ins),
            "Q_L": _distinct([[c] for c in order], outs),
        }
    groups = {"u_Qi": ins, "Q_L": outs}
    return Roles({role: group for role, group in groups.items() if group}, "river", instead)


def _unmistakable(ins: Group, outs: Group, flows: Group) -> bool:
    """Whether names alone tell the inflow and the outflow, and no other could be meant."""
    sure_in = [c for c in flows if c.sure and c.role == "u_Qi"]
    sure_out = [c for c in flows if c.sure and c.role != "u_Qi"]
    return len(ins) == 1 and len(outs) <= 1 and ins == sure_in and outs == sure_out


def _sites(columns: Group) -> dict[str, str]:
    """The site of each column by its name: the first word that they do not all share; empty for none."""
    words = {c.name: _BREAK.split(re.sub(r"[\[(].*", "", c.name).strip().lower()) for c in columns}
    shared = 0
    while all(len(w) > shared + 1 for w in words.values()) and len({w[shared] for w in words.values()}) == 1:
        shared += 1
    sites = {}
    for name, parts in words.items():
        site = parts[shared] if len(parts) > shared + 1 else ""
        sites[name] = "" if _NO_SITE.fullmatch(site) else site
    return sites


def _by_site(
    flows: Group, level: ColumnGuess, sites: dict[str, str]
) -> tuple[Group, Group, tuple[str, str]] | None:
    """The flows of the level's site, downstream, and those of the first other one; None without two sites."""
    here = sites[level.name]
    others = [sites[c.name] for c in flows if sites[c.name] not in ("", here)]
    own = [c for c in flows if sites[c.name] == here]
    if not here or not own or not others:
        return None
    outs = _leaving(own)
    ins = _leaving([c for c in flows if sites[c.name] == others[0]])
    said = _said_site(ins[0].name, others[0]), _said_site(level.name, here)
    return ins, outs, (f"of {said[0]}, not of the level's site", f"of {said[1]}, as the level")


def _leaving(group: Group) -> Group:
    """What leaves a site: not what is called its inflow, and a total rather than the sum of all."""
    group = [c for c in group if not (c.sure and c.role == "u_Qi")] or group
    return [c for c in group if _TOTAL.search(c.name.lower())][:1] or group


def _said_site(name: str, site: str) -> str:
    at = name.lower().find(site)
    return name[: at + len(site)]


def _by_name(flows: Group, sites: dict[str, str]) -> tuple[Group, Group, tuple[str, str]]:
    """By what the columns are called, else in their order."""
    called_in = sorted((c for c in flows if c.role == "u_Qi"), key=lambda c: not c.sure)
    called_out = [c for c in flows if c.role == "u_Qo"]
    neutral = [c for c in flows if c.role == "flow"]
    ins = called_in[:1] or neutral[:1]
    outs = called_out or [c for c in [*neutral, *called_in] if c not in ins][:1]
    if any(c.sure for c in outs):
        outs = [c for c in outs if c.sure]
    if all(sites[c.name] for c in outs):  # sites are never mixed in a sum
        outs = [c for c in outs if sites[c.name] == sites[outs[0].name]]
    outs = [c for c in outs if _TOTAL.search(c.name.lower())][:1] or outs
    if not ins:
        ins = [c for c in called_out if c not in outs and sites[c.name] != sites[outs[0].name]][:1]
    guessed = "guessed by its name"
    first = "it is only the first discharge" if ins and ins[0].role == "flow" else guessed
    return ins, outs, (first, "its name does not tell" if outs and outs[0].role == "flow" else guessed)


def _ask_which(ins: Group, outs: Group, flows: Group, why: tuple[str, str], questions: Questions) -> None:
    if _unmistakable(ins, outs, flows):
        return
    for role, what, group, reason in (("u_Qi", "inflow", ins, why[0]), ("u_Qo", "outflow", outs, why[1])):
        if len(group) > 1:
            names = ", ".join(c.name for c in group)
            questions.ask(role, f"{role}: is the sum of {names} the {what}? ({reason}; a list is a sum)")
        elif group:
            questions.ask(role, f"{role}: is {group[0].name} the {what}? ({reason})")


def _others(ins: Group, outs: Group, flows: Group, sites: dict[str, str]) -> dict[str, list[Group]]:
    """What else the inflow and the outflow may be: each other, all of another site, any other column."""
    by_site: dict[str, Group] = {}
    for column in flows:
        if sites[column.name]:
            by_site.setdefault(sites[column.name], []).append(column)
    whole = [_leaving(group) for group in by_site.values()]
    left = [[c] for c in flows if c not in ins and c not in outs]
    return {
        "u_Qi": _distinct([outs, *whole, *left], ins),
        "u_Qo": _distinct([ins, *whole, *left], outs),
    }


def _distinct(groups: Sequence[Group], but: Group) -> list[Group]:
    kept: list[Group] = []
    for group in groups:
        if group and group != but and group not in kept:
            kept.append(group)
    return kept[:MOST]
