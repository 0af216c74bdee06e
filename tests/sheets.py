"""Data sheets, sound and faulty."""

GOOD = {
    "bore_diameter": '"100 mm"',
    "rod_diameter": '"56 mm"',
    "stroke": '"1 m"',
    "dead_volume_a": '"0.2 L"',
    "dead_volume_b": '"0.2 L"',
    "bulk_modulus": '"1.5 GPa"',
    "rated_flow": '"100 L/min"',
    "rated_pressure_drop_per_edge": '"35 bar"',
    "supply_pressure": '"210 bar"',
    "tank_pressure": '"1 bar"',
    "mass": '"200 kg"',
}


def written(changes: dict) -> str:
    lines = {key: value for key, value in (GOOD | changes).items() if value is not None}
    return "\n".join(f"{key} = {value}" for key, value in lines.items())


MALFORMED = [
    ({"stroke": '"1 bar"'}, ["stroke = '1 bar' has an unknown unit or one of the wrong dimension"]),
    ({"stroke": '"3,5 mm"'}, ["stroke = '3,5 mm' is not one number with one unit"]),
    ({"rated_flow": '"40 L/min @ 70 bar"'}, ["rated_flow = '40 L/min @ 70 bar' is not one number"]),
    ({"stroke": '"4..20"'}, ["stroke = '4..20' is not one number"]),
    ({"stroke": '"10 ± 1 mm"'}, ["stroke = '10 ± 1 mm' is not one number"]),
    ({"stroke": '"one metre"'}, ["stroke = 'one metre' is not one number"]),
    ({"stroke": '""'}, ["stroke = '' is not one number"]),
    ({"stroke": '"10 parsnips"'}, ["stroke = '10 parsnips' has an unknown unit"]),
    ({"stroke": "nan"}, ["stroke = nan is not finite"]),
    ({"stroke": "inf"}, ["stroke = inf is not finite"]),
    ({"stroke": '"1e400 m"'}, ["stroke = '1e400 m' is not finite"]),
    ({"mass": "true"}, ["mass = True is not a quantity"]),
    ({"mass": "[200]"}, ["mass = [200] is not a quantity"]),
    ({"mass": "{ value = 200 }"}, ["mass = {'value': 200} is not a quantity"]),
    ({"mass": "2024-05-01"}, ["mass = datetime.date(2024, 5, 1) is not a quantity"]),
    ({"mass": "0"}, ["mass = 0 kg must be above 0"]),
    ({"mass": '"-200 kg"'}, ["mass = -200 kg must be above 0"]),
    (
        {"mass": '"200 lb/ft"'},
        ["mass = '200 lb/ft' has an unknown unit or one of the wrong dimension"],
    ),
    ({"mass": None}, ["mass is missing"]),
    ({"stroke": "0"}, ["stroke = 0 m must be above 0"]),
    ({"leakage": "-1e-13"}, ["leakage = -1e-13 m^3/s/Pa must be at least 0"]),
    ({"rod_diameter": '"100 mm"'}, ["rod_diameter = 0.1 m is not below bore_diameter = 0.1 m"]),
    ({"rod_diameter": '"0.2 m"'}, ["rod_diameter = 0.2 m is not below bore_diameter"]),
    ({"rod_diameter": '"-5 mm"'}, ["rod_diameter = -0.005 m must be above 0"]),
    ({"rod_diameter_a": '"120 mm"'}, ["rod_diameter_a = 0.12 m is not below bore_diameter"]),
    ({"tank_pressure": '"210 bar"'}, ["tank_pressure = 2.1e+07 Pa is not below supply_pressure"]),
    ({"tank_pressure": '"-1 bar"'}, ["tank_pressure = -100000 Pa must be at least 0"]),
    ({"dead_volume_a": "0"}, ["dead_volume_a = 0 m^3 must be above 0"]),
    ({"dead_volume_b": None}, ["dead_volume_b is missing"]),
    ({"hose_volume_a": '"-1 L"'}, ["hose_volume_a = -0.001 m^3 must be at least 0"]),
    (
        {"hose_volume": '"1 L"', "hose_volume_a": '"1 L"'},
        ["hose_volume is given in all and per side"],
    ),
    ({"area_a": '"50 cm^2"'}, ["area_a and bore_diameter, rod_diameter are both given"]),
    (
        {"flow_coefficient": "1e-6"},
        ["flow_coefficient and rated_flow, rated_pressure_drop_per_edge are both given"],
    ),
    (
        {"rated_pressure_drop_per_edge": None},
        ["give one of rated_pressure_drop_per_edge and rated_pressure_drop_per_valve"],
    ),
    (
        {"rated_pressure_drop_per_valve": '"70 bar"'},
        ["give one of rated_pressure_drop_per_edge and rated_pressure_drop_per_valve"],
    ),
    ({"rated_flow": "0"}, ["rated_flow = 0 m^3/s must be above 0"]),
    ({"rated_flow": None}, ["rated_flow is missing"]),
    (
        {"rated_pressure_drop": '"35 bar"'},
        ["key 'rated_pressure_drop' is unknown; did you mean 'rated_pressure_drop_per"],
    ),
    (
        {"bulk_modulous": '"1.5 GPa"'},
        ["key 'bulk_modulous' is unknown; did you mean 'bulk_modulus'"],
    ),
    ({"valve": "{ natural_frequency = 300 }"}, ["key 'valve' is unknown"]),
    ({"name": "7"}, ["name = 7 is not a text"]),
    (
        {"dead_band": '"5 mm"'},
        [
            "dead_band = '5 mm' has an unknown unit or one of the wrong dimension; write a plain"
            " number"
        ],
    ),
    ({"dead_band": "1.5"}, ["dead_band = 1.5 must be below 1"]),
    ({"valve_natural_frequency": '"50 Hz"'}, ["valve_damping is missing"]),
    ({"valve_damping": "0.7"}, ["valve_damping = 0.7 needs valve_natural_frequency"]),
    ({"breakaway_friction": '"1 kN"'}, ["stribeck_speed is missing"]),
    ({"valve_rate_limit": '"10 1/s"'}, ["valve_rate_limit = 10 needs valve_natural_frequency"]),
    (
        {"coulomb_friction": "200", "breakaway_friction": "100"},
        ["breakaway_friction = 100 N is below coulomb_friction = 200 N"],
    ),
    (
        {
            "dead_volume_a": None,
            "dead_volume_b": None,
            "volume_a": '"0.2 L"',
            "volume_b": '"0.2 L"',
        },
        ["volume_b = 0.0002 m^3 is used up before the end of the stroke"],
    ),
    (
        {"bore_diameter": '"1e200 m"', "dead_volume_b": "-1"},
        ["area_a = inf", "area_b = inf", "dead_volume_b = -1 m^3"],
    ),
    (
        {"valve_natural_frequency": '"50 bar"', "mass": "-1"},
        ["valve_natural_frequency = '50 bar'", "mass", "valve_damping is missing"],
    ),
    (
        {"valve_damping": "-1"},
        ["valve_damping = -1 must be above 0", "valve_damping needs valve_natural_frequency"],
    ),
    (
        {"mass": "0x" + "f" * 5000, "name": "0xf" + "f" * 5000},
        ["mass = (int too long to print)", "name = (int too long to print)"],
    ),
    (
        {"mass": "-1", "stroke": '"3,5 mm"', "colour": '"red"', "supply_pressure": None},
        ["mass = -1 kg", "stroke", "colour", "supply_pressure"],
    ),
    (
        dict.fromkeys(GOOD),
        [
            "area_a, area_b is missing",
            "volume_a, volume_b",
            "flow_coefficient",
            "stroke",
            "bulk",
            "supply",
            "mass",
        ],
    ),
]


UNREADABLE = {
    "empty": (b"", "is missing"),
    "binary": (bytes(range(256)), "is not UTF-8 text"),
    "utf16": ("mass = 1".encode("utf-16"), "is not UTF-8 text"),
    "large": (b"# text\n" * 1_500_000, "more than 100 kB is no data sheet"),
    "many keys": (
        b"".join(b"key%d = 1\n" % k for k in range(5000)),
        "5000 keys are unknown, 'key0' the first",
    ),
    "long key": (b"k" * 50_000 + b" = 1\n", "key 'kkkk"),
    "duplicate": (
        b"mass = 1\nmass = 2\n",
        "not valid TOML in 'mass = 2' (Cannot overwrite a value (at line 2",
    ),
    "no quotes": (b"mass = 1\nstroke = 3,5 mm\n", "not valid TOML in 'stroke = 3,5 mm'"),
    "no value": (b"mass\n", "not valid TOML"),
    "open quote": (b'mass = "200 kg\n', "not valid TOML"),
    "json": (b'{"mass": 200}', "not valid TOML"),
    "deep": (b"mass = " + b"[" * 5000 + b"]" * 5000, "machine.toml"),
    "section": (b"[mass]\nvalue = 1\n", "mass = {'value': 1} is not a quantity"),
    "long integer": (b"mass = " + b"9" * 20_000, "not valid TOML"),
    "huge integer": (b"mass = " + b"9" * 4_000, "is not finite"),
    "null byte": (b"mass = 1\x00", "not valid TOML"),
}
