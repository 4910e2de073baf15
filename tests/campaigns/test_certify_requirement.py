"""A requirement's file: what it asks, its conditions, what it is flown with, and what is refused in one line."""

from __future__ import annotations

import pytest

from flownav.campaigns.requirement import SHIPPED, load_requirement, needed_by, scenario_of
from flownav.core.errors import InputError
from flownav.core.parameter_files import shipped

HEAD = 'schema_version = 1\nname = "mine"\nscenario = "landing"\n'
ASKED = '[[requirement]]\nmeasure = "touchdown.horizontal_m"\nat_most = 0.5\nprobability = 0.997\n'


@pytest.fixture
def written(tmp_path):
    def write(text, name="mine.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


def test_the_words_of_a_test_plan(written):
    (table,) = load_requirement(written(HEAD + ASKED + "confidence = 0.9\n")).requirement
    assert (table.limit, table.upper, table.probability, table.confidence) == (0.5, True, 0.997, 0.9)
    assert table.sentence() == "touchdown.horizontal_m at most 0.5 m with 99.7 % probability at 90 % confidence"
    assert [needed_by(table, failures) for failures in (0, 1, 2)] == [767, 1296, 1773]
    crash = '[[requirement]]\nmeasure = "crash"\nat_most = 0\nprobability = 0.95\nconfidence = 0.95\n'
    crash += "allowed_failures = 0\n"
    both = load_requirement(written(HEAD + ASKED + crash))
    assert both.flights() == 1773
    assert both.requirement[1].sentence() == "no crash with 95 % probability at 95 % confidence"
    lower = written(HEAD + '[[requirement]]\nmeasure = "touchdown.tilt_deg"\nat_least = 1\nprobability = 0.9\n')
    assert "at least 1 deg" in load_requirement(lower).requirement[0].sentence()


def test_conditions_are_ranges_and_lists(written):
    text = (
        HEAD
        + "[conditions]\nwind.speed_20ft_m_s = [0, 8]\nheight_m = [2, 4]\n"
        + 'fault = ["none", "gps_loss"]\nsensor = ["scenario", "own.toml"]\nvehicle = ["quad-450", "x.toml"]\n'
        + 'wind.from_direction_deg = { distribution = "norm", loc = 90, scale = 20 }\n'
        + "[conditions.vehicle_numbers]\n"
    )
    asked = load_requirement(written(text.replace("[conditions.vehicle_numbers]\n", "") + ASKED))
    speed, direction = (asked.conditions.ranges[f"wind.{name}"] for name in ("speed_20ft_m_s", "from_direction_deg"))
    assert (speed.distribution, speed.loc, speed.scale) == ("uniform", 0.0, 8.0)
    assert (direction.distribution, direction.loc) == ("norm", 90.0)
    assert asked.conditions.heights_m() == (2.0, 3.0, 4.0)
    assert asked.conditions.fault == ("none", "gps_loss")
    here = written("", "own.toml")
    assert asked.conditions.sensor == ("scenario", here)
    assert asked.conditions.vehicle == ("quad-450", here.replace("own.toml", "x.toml"))


def test_what_it_sets_and_its_ranges_stand_above_the_scenarios(written):
    text = HEAD + "[set.wind]\ngusts = true\nspeed_20ft_m_s = 3\n[conditions]\nwind.speed_20ft_m_s = [0, 8]\n"
    text += "sensor_noise.x = [0, 1]\n"
    scenario = scenario_of(load_requirement(written(text + ASKED)))
    assert scenario.wind.gusts
    assert scenario.wind.speed_20ft_m_s == 3.0
    assert scenario.flight.start == "hover"
    entries = scenario.dispersion.entries()
    assert (entries["wind.speed_20ft_m_s"].loc, entries["wind.speed_20ft_m_s"].scale) == (0.0, 8.0)
    assert entries["wind.speed_20ft_m_s"].known == "day"
    assert entries["sensor_noise.x"].known == "day"
    assert entries["vehicle.body.mass_kg"].known == "build"
    assert scenario_of(load_requirement(written(HEAD + ASKED)), "quad-450").vehicle.file == "quad-450"


def test_files_that_it_names_lie_beside_it(written, tmp_path):
    own = written((shipped("landing.toml")).read_text(encoding="utf-8"), "own.toml")
    asked = load_requirement(written('schema_version = 1\nname = "mine"\nscenario = "own.toml"\n'
                                     '[set.sensors]\ninertial = "imu.toml"\ntexture = "pad"\n' + ASKED))  # fmt: skip
    assert asked.scenario == own
    assert asked.set["sensors"] == {"inertial": str(tmp_path / "imu.toml"), "texture": "pad"}


@pytest.mark.parametrize("name", SHIPPED)
def test_the_shipped_requirements_can_be_flown(name):
    asked = load_requirement(name)
    assert asked.name == name
    assert asked.flights() > 0
    scenario = scenario_of(asked)
    assert scenario.wind.gusts
    assert scenario.wind.speed_20ft_m_s == (8.0 if name == "approach_8_m_s" else 4.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD, "requirement: missing; add it"),
        (
            HEAD + ASKED.replace("touchdown.horizontal_m", "luck"),
            "requirement.0.measure: no such measure; known: touch",
        ),
        (HEAD + ASKED.replace("at_most = 0.5", ""), "give one of at_most and at_least"),
        (HEAD + ASKED + "at_least = 0.1\n", "give one of at_most and at_least"),
        (HEAD + ASKED.replace("0.997", "1"), "requirement.0.probability: Input should be less than 1"),
        (HEAD + ASKED + "confidence = 0\n", "requirement.0.confidence: Input should be greater than or equal to 0.5"),
        (HEAD + ASKED + "confidence = 1\n", "requirement.0.confidence: Input should be less than 1"),
        (HEAD + ASKED + "confidence = nan\n", "requirement.0.confidence: Input should be a finite number"),
        (HEAD + ASKED.replace("0.997", "nan"), "requirement.0.probability: Input should be a finite number"),
        (HEAD + ASKED.replace("0.997", "0"), "requirement.0.probability: Input should be greater than 0"),
        (HEAD + ASKED.replace("0.5", "nan"), "requirement.0.at_most: Input should be a finite number"),
        (HEAD + ASKED.replace("0.5", "inf"), "requirement.0.at_most: Input should be a finite number"),
        (HEAD + ASKED + "allowed_failures = nan\n", "requirement.0.allowed_failures"),
        (HEAD + "[conditions]\nwind.speed_20ft_m_s = [nan, 8]\n" + ASKED, "a range is [low, high], low below high"),
        (HEAD + "[conditions]\nheight_m = [2, inf]\n" + ASKED, "conditions.height_m"),
        (HEAD + ASKED + "allowed_failures = -1\n", "requirement.0.allowed_failures"),
        (HEAD + "[conditions]\nwind.speed_20ft_m_s = 4\n" + ASKED, "wind.speed_20ft_m_s: a range is [low, high]"),
        (HEAD + "[conditions]\nwind.speed_20ft_m_s = [8, 0]\n" + ASKED, "a range is [low, high], low below high"),
        (HEAD + "[conditions]\nheight_m = [8, 2]\n" + ASKED, "conditions.height_m: a range is [low, high]"),
        (HEAD + '[conditions]\nfault = ["gps_loss", "gps_loss"]\n' + ASKED, "conditions.fault: the same twice"),
        (HEAD + "sped = 3\n" + ASKED, "sped: unknown key"),
        (HEAD + ASKED.replace("0.5", "-0.3"), "at_most -0.3: no flight has a touchdown.horizontal_m below 0"),
        (HEAD + "[conditions]\nwind.speed_20ft_m_s = [-5, 4]\n" + ASKED, "a wind's speed begins at 0; where it comes"),
    ],
)
def test_mistakes_are_one_line(written, text, said):
    path = written(text)
    with pytest.raises(InputError) as error:
        load_requirement(path)
    assert said in str(error.value)
    assert str(error.value).startswith(path)
    assert "\n" not in str(error.value)


def test_a_name_that_is_none_and_a_demand_that_is_too_large(written):
    with pytest.raises(InputError, match=r"^aproach: no such requirement; shipped: takeoff, landing, "):
        load_requirement("aproach")
    with pytest.raises(InputError, match=r"mine: set: wind.sped: unknown key"):
        scenario_of(load_requirement(written(HEAD + "[set.wind]\nsped = 1\n" + ASKED)))
    large = load_requirement(written(HEAD + ASKED.replace("0.997", "0.9999999999")))
    with pytest.raises(InputError, match=r"needs more than 1,000,000,000 flights; ask for less, or use `flownav camp"):
        large.flights()
