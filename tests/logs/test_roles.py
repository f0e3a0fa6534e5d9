"""Test the roles of discharges, by site and by name: a question wherever there is doubt."""

import tomllib

import pytest

from rivid.logs.sniff.propose import sniff


@pytest.fixture
def proposed(tmp_path):
    """Return the proposal of sniff for a table with these columns."""

    def propose(*names):
        rows = [
            ",".join([f"2024-04-03T{h:02d}:00Z", *(f"{10 * j + h % 5}.5" for j, _ in enumerate(names, 1))])
            for h in range(24)
        ]
        path = tmp_path / "export.csv"
        path.write_text("\n".join([",".join(["time", *names]), *rows]) + "\n", encoding="utf-8")
        return sniff(path)

    return propose


def given(proposal):
    return tomllib.loads(proposal.toml)["input"]


def choices(proposal, key):
    """Return the alternatives in comments, ready to replace a key."""
    lines = [line[2:] for line in proposal.toml.split("\n") if line.startswith(f"# {key} = ")]
    return [tomllib.loads(line)[key] for line in lines]


@pytest.mark.parametrize(
    ("inflow", "outflow", "level"),
    [
        ("Vazão afluente (m3/s)", "Vazão defluente (m3/s)", "Cota montante (m)"),
        ("Caudal afluente", "Caudal efluente", "Nível da albufeira"),
        ("Débit des apports", "Débit sortant", "Cote du plan d'eau"),
        ("Portata in arrivo", "Portata scaricata a valle (m3/s)", "Quota invaso (m s.l.m.)"),
        ("Portata a monte", "Portata a valle", "Altezza idrometrica"),
        ("Caudal entrante", "Caudal saliente", "Altura de lámina"),
        ("Zufluss m3/s", "Abgabe m3/s", "OWP m ü.A."),
        ("Zulauf", "Ablauf", "Stauspiegel"),
        ("Zulauf", "Ablauf", "X7"),
        ("ZU", "AB", "PEGEL"),
    ],
)
def test_the_words_of_other_languages_are_known(proposed, inflow, outflow, level):
    found = given(proposed(outflow, level, inflow))
    assert (found["u_Qi"], found["u_Qo"], found["h_L"]) == (inflow, outflow, level)


PLANTS = ("LR.U1.FLOW", "LR.U2.FLOW", "LR.SPILL", "MD.TOTAL.RELEASE", "MD.FOREBAY.ELEV")


def test_the_site_of_the_level_is_downstream_and_the_flows_of_the_other_are_the_inflow(proposed):
    found = given(proposed(*PLANTS))
    assert found["u_Qi"] == list(PLANTS[:3]) and found["u_Qo"] == PLANTS[3]
    assert found["h_L"] == "MD.FOREBAY.ELEV"


def test_both_are_asked_for_and_the_other_choices_stand_below_them(proposed):
    proposal = proposed(*PLANTS)
    assert {"u_Qi", "u_Qo"} <= dict(proposal.questions).keys()
    assert choices(proposal, "u_Qi") == ["MD.TOTAL.RELEASE"]
    assert choices(proposal, "u_Qo") == [list(PLANTS[:3])]
    assert "a list is a sum" in " ".join(text for _, text in proposal.questions)


@pytest.mark.parametrize(
    ("names", "inflow", "outflow"),
    [
        (("LR.OUTFLOW", "MD.OUTFLOW", "MD.LEVEL"), "LR.OUTFLOW", "MD.OUTFLOW"),
        (("MD.INFLOW", "MD.OUTFLOW", "MD.LEVEL", "LR.OUTFLOW"), "LR.OUTFLOW", "MD.OUTFLOW"),
        (("MD.U1.Q", "MD.U2.Q", "MD.TOTAL.Q", "LR.Q", "MD.ELEV"), "LR.Q", "MD.TOTAL.Q"),
        (("A.FLOW", "B.FLOW", "C.FLOW", "C.LEVEL"), "A.FLOW", "C.FLOW"),
        (("A.SPILL", "B.SPILL", "LEVEL"), "B.SPILL", "A.SPILL"),
        (("Station 1 Flow", "Station 2 Flow", "Station 2 Stage"), "Station 1 Flow", "Station 2 Flow"),
        (("P.LR_TW", "P.LR_Q", "P.MD_FLOW", "P.MD_LEVEL"), "P.LR_Q", "P.MD_FLOW"),
        (("Q Unterwasser", "Q Oberwasser", "Pegel"), "Q Oberwasser", "Q Unterwasser"),
        (("Q_UW", "Q_OW", "Pegel"), "Q_OW", "Q_UW"),
        (("débit aval", "débit amont", "cote"), "débit amont", "débit aval"),
        (("caudal aguas abajo", "caudal aguas arriba", "nivel"), "caudal aguas arriba", "caudal aguas abajo"),
        (("flow b", "flow a", "level"), "flow b", "flow a"),
    ],
)
def test_what_names_leave_open_is_asked_with_the_way_out(proposed, names, inflow, outflow):
    proposal = proposed(*names)
    found = given(proposal)
    assert (found["u_Qi"], found["u_Qo"]) == (inflow, outflow)
    assert {"u_Qi", "u_Qo"} <= dict(proposal.questions).keys()
    assert outflow in choices(proposal, "u_Qi") and inflow in choices(proposal, "u_Qo")


@pytest.mark.parametrize(
    "names",
    [
        ("inflow", "outflow", "level"),
        ("u_Qi", "u_Qo", "h_L"),
        ("Zufluss", "Abfluss", "Wasserstand"),
        ("débit entrant", "débit sortant", "cote"),
        ("PLANT.UP.FLOW_IN", "PLANT.DN.FLOW_OUT", "PLANT.DN.LEVEL"),
    ],
)
def test_names_that_say_it_are_not_asked_about(proposed, names):
    proposal = proposed(*names)
    assert not {"u_Qi", "u_Qo"} & dict(proposal.questions).keys()
    assert given(proposal).get("u_Qi", "u_Qi") == names[0]
    assert given(proposal).get("u_Qo", "u_Qo") == names[1]
    assert not choices(proposal, "u_Qi")


def test_no_sum_holds_columns_of_two_sites(proposed):
    for names in (
        PLANTS,
        ("A.GATE", "B.GATE", "inflow", "level"),
        ("A.Q", "B.Q", "B.SPILL", "C.SPILL", "C.H"),
    ):
        proposal = proposed(*names)
        sums = [given(proposal).get(key) for key in ("u_Qi", "u_Qo")]
        sums += choices(proposal, "u_Qi") + choices(proposal, "u_Qo")
        for columns in sums:
            assert isinstance(columns, str) or len({name.split(".")[0] for name in columns}) == 1


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("inflow", "unit_1", "unit_2", "gates", "level"), {"u_Qo": ["unit_1", "unit_2", "gates"]}),
        (("inflow", "outflow", "gate [m]", "level [m]"), {"u_Qo": "outflow"}),  # an opening, not a discharge
        (
            ("OW [m]", "UW [m]", "Q OW [m3/s]", "Q UW [m3/s]"),
            {"h_L": "OW [m]", "u_Qi": "Q OW [m3/s]", "u_Qo": "Q UW [m3/s]"},
        ),
    ],
)
def test_units_and_kinds_of_columns_decide_their_roles(proposed, names, expected):
    found = given(proposed(*names))
    assert {key: found[key] for key in expected} == expected


@pytest.mark.parametrize(
    ("names", "inflow", "outflow", "level"),
    [
        # the side of the reach stands in the name
        ("Upstream Total Outflow (kcfs)|Downstream Total Outflow (kcfs)|Forebay (ft)", 0, 1, 2),
        ("Abfluss Unterlieger [m³/s]|Abfluss Oberlieger [m³/s]|Pegel Oberwasser [m ü. NN]", 1, 0, 2),
        ("Caudal turbinado aguas arriba|Caudal turbinado aguas abajo|Nivel", 0, 1, 2),
        ("Upper pool level (m)|Lower pool level (m)|Upper release (m3/s)|Lower release (m3/s)", 2, 3, 1),
        ("Release Upper Weir (ML/d)|Release Lower Weir (ML/d)|Level Lower Weir (mAHD)", 0, 1, 2),
        # the site is the last word
        ("Débit sortant Bourg|Débit sortant Beaumont|Cote Bourg", 1, 0, 2),
        # all that leaves
        ("Zufluss|Turbine 1|Wehr|Pegel OW [m]", 0, (1, 2), 3),
        ("Inflow (cfs)|Powerhouse flow (cfs)|Weir flow (cfs)|Pool level (ft)", 0, (1, 2), 3),
        # other quantities
        ("Upstream release (m3/s)|Unit 1 MW|Unit 1 flow (m3/s)|Headwater level (m)", 0, 2, 3),
        ("Q amont (m3/s)|Ouverture vanne 1 (m)|Q aval (m3/s)|Cote (m)", 0, 2, 3),
        ("Inflow temp (C)|Inflow (m3/s)|Outflow (m3/s)|Level (m)", 1, 2, 3),
        ("Rainfall (mm)|Inflow volume (m3)|Inflow|Outflow|Stage", 2, 3, 4),
        ("Level setpoint (m)|Level (m)|Inflow setpoint (m3/s)|Inflow (m3/s)|Outflow (m3/s)", 3, 4, 1),
        ("Q_up|Q_dn|H_dn", 0, 1, 2),
        ("KW1.QAB|KW2.QAB|KW2.OWP", 0, 1, 2),
        ("KW2.QZU|KW2.QAB|KW2.OWP", 0, 1, 2),
        # a side that all columns name decides nothing
        ("Upper Dam inflow|Upper Dam turbine 1|Upper Dam turbine 2|Upper Dam level", 0, (1, 2), 3),
        ("Inflow|Turbine flow east|Turbine flow west|Level west", 0, (1, 2), 3),
        ("Zufluss Windach|Abfluss Windach|Pegel Windach", 0, 1, 2),
    ],
)
def test_sides_sites_and_other_quantities_decide_roles(proposed, names, inflow, outflow, level):
    names = names.split("|")
    found = given(proposed(*names))
    outflow = [names[k] for k in outflow] if isinstance(outflow, tuple) else names[outflow]
    assert (found["u_Qi"], found["u_Qo"], found["h_L"]) == (names[inflow], outflow, names[level])


def test_a_sum_of_all_that_leaves_is_another_choice(proposed):
    proposal = proposed("Inflow (m3/s)", "Power (m3/s)", "Fish ladder (m3/s)", "Elevation (m)")
    assert ["Power (m3/s)", "Fish ladder (m3/s)"] in choices(proposal, "u_Qo")


def test_units_in_brackets_are_recognised_or_asked_about(proposed):
    proposal = proposed("Inflow (MGD)", "Outflow (m3/min)", "Level (furlong)")
    assert given(proposal)["units"] == {"u_Qi": "MGD", "u_Qo": "m3/min"}
    assert "the unit of h_L, 'furlong', is not known" in proposal.toml.replace("\n#  ", "")


def test_columns_that_no_name_assigns_are_other_choices_and_not_left_out(proposed):
    proposal = proposed("XA", "XB", "level")
    assert (given(proposal)["u_Qi"], given(proposal)["u_Qo"], given(proposal)["h_L"]) == ("XA", "XB", "level")
    assert {"u_Qi", "u_Qo"} <= dict(proposal.questions).keys() and "columns left out" not in proposal.toml
    proposal = proposed("inflow", "level", "P1", "Temp [°C]")
    assert "u_Qo" not in given(proposal) and choices(proposal, "u_Qo") == ["P1"]  # a temperature is no flow
    question = 'u_Qo: is it P1, or "" as the outflow is not logged?'
    assert ("u_Qo", question) in proposal.questions
    assert given(proposed("inflow", "level"))["u_Qo"] == ""
    proposal = proposed("QZ", "QA", "W1", "rain mm")
    assert proposal.kind == "river" and choices(proposal, "h_L") == ["W1"]
    assert "h_L" in dict(proposal.questions)
    proposal = proposed("QZ", "QA", "W")
    assert (given(proposal)["h_L"], proposal.kind) == ("W", "pool")


def test_two_discharges_of_a_river_are_asked_about_unless_named(proposed):
    proposal = proposed("Q1 [m3/s]", "Q2 [m3/s]")
    assert "u_Qi" in dict(proposal.questions) and choices(proposal, "Q_L") == ["Q1 [m3/s]"]
    assert "u_Qi" not in dict(proposed("u_Qi", "Q_L").questions)
