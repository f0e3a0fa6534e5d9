"""Which column, or tag, is which canonical one: by name, and asked where names do not tell."""

from rivid.logs.guess import ColumnGuess
from rivid.logs.proposal import Questions


def roles_of(columns: list[ColumnGuess], questions: Questions) -> tuple[dict[str, list[ColumnGuess]], str]:
    """Which column is which; several columns that leave the reach are summed.

    Parameters
    ----------
    columns : list of ColumnGuess
    questions : Questions
        Gets what names do not tell.

    Returns
    -------
    roles : dict of list of ColumnGuess
        By canonical column.
    kind : {"pool", "river"}
    """
    roles: dict[str, list[ColumnGuess]] = {}
    by_role = {role: [c for c in columns if c.role == role] for role in ("u_Qi", "u_Qo", "h_L", "flow")}
    flows = by_role["flow"]
    if by_role["h_L"]:
        roles["h_L"] = by_role["h_L"][:1]
        roles["u_Qi"] = by_role["u_Qi"][:1] or flows[:1]
        roles["u_Qo"] = by_role["u_Qo"] or [c for c in flows if c not in roles["u_Qi"]][:1]
        kind = "pool"
        if roles["u_Qi"] and roles["u_Qi"][0] in flows:
            questions.ask(
                "u_Qi", f"u_Qi: is {roles['u_Qi'][0].name} the inflow? It is only the first discharge"
            )
        if any(column in flows for column in roles["u_Qo"]):
            questions.ask("u_Qo", f"u_Qo: is {roles['u_Qo'][0].name} the outflow? Its name does not tell")
        if len(by_role["h_L"]) > 1:
            names = ", ".join(c.name for c in by_role["h_L"])
            questions.ask("h_L", f"h_L: which of {names} is the level at the downstream dam?")
    else:
        named, others = by_role["u_Qi"][:1], [*flows, *by_role["u_Qo"]]
        order = [*named, *others, *by_role["u_Qi"][1:]]  # what is not called an inflow is rather the output
        roles["u_Qi"], roles["Q_L"], kind = order[:1], order[1:2], "river"
        if len(order) > 2:
            questions.ask(
                "u_Qi", "more than two discharges and no level: which is the inflow, which the output?"
            )
    if len(by_role["u_Qi"]) > 1 and kind == "pool":
        names = ", ".join(c.name for c in by_role["u_Qi"])
        questions.ask("u_Qi", f"u_Qi: which of {names}, or the sum of some?")
    if not roles["u_Qi"]:
        questions.ask("u_Qi", "no column is called like an inflow: set u_Qi")
    if kind == "river" and not roles["Q_L"]:
        questions.ask(
            "h_L", "no column is called like a level or a second discharge: set h_L, or Q_L of a river"
        )
    if len(roles.get("u_Qo", [])) > 1:
        questions.ask("u_Qo", f"u_Qo: the sum of {', '.join(c.name for c in roles['u_Qo'])}?")
    return {role: group for role, group in roles.items() if group}, kind
