"""An ensemble: its draws and their distributions, that no part on board knows them, and that a flight is the same
whoever asks for it.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import flownav
from flownav.core.compile import LANES
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.core.parameter_files import check, shipped
from flownav.simulation.assemble import assemble
from flownav.simulation.dispersion import Distribution, drawn, uniforms
from flownav.simulation.engine import fly_blocks, fly_one, fly_written
from flownav.simulation.ensemble import LOT_FLIGHTS, believed
from flownav.simulation.history import column, columns
from flownav.simulation.scenario import SHIPPED, Scenario, load_scenario
from flownav.simulation.truth import Truth

SHORT, SOON = {"duration_s": 3.0}, {"handover_s": 1.0}


def setup(name, **sections):
    entries = load_scenario(name).model_dump(exclude_unset=True)
    for key, value in sections.items():
        entries[key] = {**entries.get(key, {}), **value} if isinstance(value, dict) else value
    return assemble(check(entries, Scenario, "test"))


def alone(tmp_path, entries, name="approach", **sections):
    """A scenario whose only dispersion is these lines of TOML."""
    empty = tmp_path / "none.toml"
    head = 'schema_version = 1\nname = "few"\nprovenance = "test"\n[dispersion]\n'
    empty.write_text(head + entries, encoding="utf-8")
    return setup(name, dispersion={"file": str(empty)}, **sections)


def test_a_direction_of_the_wind_that_is_asked_for_is_that_of_every_flight():
    loaded = flownav.Scenario.load("approach")
    for asked in ({"wind": "12:180"}, {"wind": {"from_direction_deg": 180.0}}, {"wind.from_direction_deg": 180.0}):
        found = assemble(loaded.changed(**asked).file)
        values = found.ensemble().values(1, 0, 8)
        assert "wind.from_direction_deg" not in values
        assert np.std(values["wind.speed_20ft_m_s"]) > 0.1  # the speed is still drawn
        toward = [truth.wind.toward_n for truth in found.ensemble().truths(1, 0, 8)]
        assert toward == pytest.approx([1.0] * 8)
    assert len(set(assemble(loaded.changed(wind="12").file).ensemble().values(1, 0, 8)["wind.from_direction_deg"])) == 8


def test_what_a_scenario_fixes_is_drawn_in_no_flight():
    entries = setup("approach", dispersion={"fixed": ["wind.roughness_m", "ground.slope_deg"]}).dispersion
    assert not {"wind.roughness_m", "ground.slope_deg"} & set(entries)
    assert len(entries) == len(setup("approach").dispersion) - 2


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("wind.from_direktion_deg", r"wind\.from_direktion_deg: no such number; known there"),
        ("wnd.from_direction_deg", r"wnd\.from_direction_deg: no such source; known: vehicle, "),
    ],
)
def test_a_misspelt_fixed_number_would_be_drawn_and_is_one_line(name, message):
    with pytest.raises(InputError, match=rf"^approach: dispersion\.{message}"):
        setup("approach", dispersion={"fixed": [name]}).ensemble()


# -- what is drawn -----------------------------------------------------------------------------------------------
def test_uniforms_are_uniform_and_each_name_and_seed_has_its_own():
    first = uniforms(1, range(20_000), "vehicle.body.mass_kg")
    assert stats.kstest(first, "uniform").pvalue > 0.01
    for other in (
        uniforms(1, range(20_000), "wind.speed_20ft_m_s"),
        uniforms(2, range(20_000), "vehicle.body.mass_kg"),
    ):
        assert abs(np.corrcoef(first, other)[0, 1]) < 0.03
    assert first[777] == uniforms(1, [777], "vehicle.body.mass_kg")[0]


@pytest.mark.parametrize(
    ("mode", "draw", "value"),
    [
        ("value", 3.0, 3.0),
        ("factor", 0.5, 50.0),
        ("offset", -2.0, 98.0),
        ("uncertainty", 0.5, 125.0),
        ("uncertainty", -0.5, 80.0),
    ],
)
def test_a_draw_is_the_value_a_factor_an_offset_or_a_share_of_the_uncertainty(mode, draw, value):
    assert drawn(mode, draw, 100.0, 40.0, 50.0) == value


def test_values_follow_scipys_distribution_about_what_the_files_say(tmp_path):
    side = '{ distribution = "uniform", loc = -1, scale = 2, mode = "uncertainty" }'
    ensemble = alone(
        tmp_path,
        'vehicle.body.mass_kg = { distribution = "norm", scale = 0.3, mode = "offset" }\n'
        f"vehicle.main_rotor.hub_stiffness_n_m_rad = {side}\n"
        'gps_receiver.position.slow_sigma_m = { distribution = "lognorm", s = 0.3, mode = "factor" }\n'
        'wind.from_direction_deg = { distribution = "uniform", loc = 0, scale = 360 }\n',
    ).ensemble()
    values = {name: np.array(column) for name, column in ensemble.values(3, 0, 4000).items()}
    assert stats.kstest(values["vehicle.body.mass_kg"], stats.norm(7.9, 0.3).cdf).pvalue > 0.01
    assert stats.kstest(values["gps_receiver.position.slow_sigma_m"], stats.lognorm(0.3, scale=1.5).cdf).pvalue > 0.01
    assert stats.kstest(values["wind.from_direction_deg"], stats.uniform(0, 360).cdf).pvalue > 0.01
    stiff = values["vehicle.main_rotor.hub_stiffness_n_m_rad"]  # 60..150 about 100
    assert (stiff.min(), stiff.max()) == pytest.approx((60.0, 150.0), abs=0.5)
    assert np.mean(stiff < 100.0) == pytest.approx(0.5, abs=0.03)


def test_the_truth_has_the_drawn_numbers_and_what_follows_from_them(tmp_path):
    ready = alone(
        tmp_path,
        'vehicle.body.mass_kg = { distribution = "uniform", loc = 8.5, scale = 0.1 }\n'
        'vehicle.main_rotor.blade_flap_inertia_kg_m2 = { distribution = "uniform", loc = 0.078, scale = 0.001 }\n'
        'wind.from_direction_deg = { distribution = "uniform", loc = 89, scale = 2 }\n'
        'gps_receiver.latency_s = { distribution = "uniform", loc = 2, scale = 0.001, mode = "factor" }\n'
        'flow_sensor.dynamics.b_1_s = { distribution = "uniform", loc = 2, scale = 0.001, mode = "factor" }\n',
    )
    told, (truth,) = believed(ready.flight), ready.ensemble().truths(1, 5, 1)
    assert 8.5 <= truth.vehicle.mass_kg <= 8.6
    assert truth.vehicle.flap_rate_1_s == pytest.approx(told.vehicle.flap_rate_1_s * 0.065 / 0.0785, rel=0.01)
    assert truth.wind.toward_e == pytest.approx(-1.0, abs=1e-3)  # from the east
    assert truth.late.gps_receiver == pytest.approx(0.12, rel=0.01)
    assert truth.carried.skid_switch.closing_load_n > 1.05 * told.carried.skid_switch.closing_load_n
    assert truth.camera_flow.lag_f22 < told.camera_flow.lag_f22
    assert truth.flow.lag_f22 == truth.camera_flow.lag_f22
    assert truth.carried._replace(skid_switch=None) == told.carried._replace(skid_switch=None)


def test_nobody_is_told(tmp_path):
    """Settings, gains, timetable and limits of the flight are the datasheets', whatever is drawn."""
    plain, ready = setup("approach"), alone(tmp_path, "", "approach")
    assert ready.ensemble().entries == {}
    assert plain.ensemble().entries
    np.testing.assert_array_equal(plain.flight.settings, ready.flight.settings)
    np.testing.assert_array_equal(plain.flight.table.t_s, ready.flight.table.t_s)
    assert plain.flight.gains == ready.flight.gains
    assert plain.flight.vehicle == ready.flight.vehicle


# -- the same flight -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("filter_", [SOON, {"name": "paper"}], ids=["the navigator", "the paper's filter"])
def test_a_flight_of_an_ensemble_is_the_same_bytes_alone_in_any_batch_and_on_any_lane(filter_):
    ready = setup("approach", flight=SHORT, filter=filter_)
    flight, ensemble, again = ready.flight, ready.ensemble(), ready.ensemble()
    by_itself = [fly_one(flight, 5, k, ensemble)[:, :, 0] for k in range(LOT_FLIGHTS - 2, LOT_FLIGHTS + 3)]
    for threads, first in ((1, LOT_FLIGHTS - 2), (2, LOT_FLIGHTS - 7)):
        blocks = [block for _, block in fly_blocks(flight, 5, first, 20, np.copy, threads, again)]
        together = np.concatenate(blocks, axis=2)
        for k, history in enumerate(by_itself):
            assert np.array_equal(together[:, :, LOT_FLIGHTS - 2 - first + k], history, equal_nan=True), (first, k)


def test_without_dispersion_an_ensemble_has_the_bytes_of_matched_flights(tmp_path):
    ready = alone(tmp_path, "", flight=SHORT, filter=SOON)
    matched, drawn_one = fly_one(ready.flight, 5, 3), fly_one(ready.flight, 5, 3, ready.ensemble())
    assert np.array_equal(matched, drawn_one, equal_nan=True)
    assert not np.array_equal(matched, fly_one(ready.flight, 5, 3, setup("approach").ensemble()), equal_nan=True)


# -- what the truth does ----------------------------------------------------------------------------------------------
def hover(tmp_path, entries, **sections):
    """Sixteen flights that hover for 12 s on the truth, with and without this dispersion."""
    wanted = {"flight": {"duration_s": 12.0}, "autopilot": {"feedback": "truth"}, "wind": {"speed_20ft_m_s": 0.0}}
    ready = alone(tmp_path, entries, "landing", **wanted, **sections)
    return ready, *(fly_written(ready.flight, 2, 0, LANES, ensemble) for ensemble in (None, ready.ensemble()))


def test_a_heavier_vehicle_hovers_with_more_thrust(tmp_path):
    heavier = 'vehicle.body.mass_kg = { distribution = "uniform", loc = 1.05, scale = 0.001, mode = "factor" }\n'
    _, matched, heavy = hover(tmp_path, heavier)
    thrust = column("truth", "thrust_n")
    ratio = heavy.history[400:, thrust].mean() / matched.history[400:, thrust].mean()
    assert ratio == pytest.approx(1.05, abs=0.005)


def test_a_wind_from_elsewhere_drives_the_vehicle_elsewhere(tmp_path):
    ready = alone(
        tmp_path, 'wind.from_direction_deg = { distribution = "uniform", loc = 269, scale = 2 }\n', "gusty",
        autopilot={"feedback": "truth"}, flight={"duration_s": 3.0}, wind={"gusts": False},
    )  # fmt: skip
    places = columns("truth", ("pos_n_m", "pos_e_m"))
    from_north = fly_one(ready.flight, 1)[-1, places, 0]
    from_west = fly_one(ready.flight, 1, 0, ready.ensemble())[-1, places, 0]
    assert abs(from_north[0]) > 3.0 * abs(from_north[1])
    assert abs(from_west[1]) > 2.0 * abs(from_west[0])  # whose nose it pushes aside as well


def test_a_late_receiver_reports_where_the_vehicle_was(tmp_path):
    """On a climb at 1 m/s, a fix that is 0.1 s older than stated is 0.1 m too low; the noise is the same."""
    late = 'gps_receiver.latency_s = { distribution = "uniform", loc = 0.1, scale = 1e-6, mode = "offset" }\n'
    ready = alone(tmp_path, late, "takeoff", flight={"duration_s": 13.0}, gps={"model": "midg"},
                  autopilot={"feedback": "truth"})  # fmt: skip
    fixes = []
    for ensemble in (None, ready.ensemble()):
        flown = fly_written(ready.flight, 2, 0, ensemble=ensemble)
        schedule = ready.fitted.schedule
        rows = (schedule.sensor[: len(flown.fed)] == Sensor.GPS_POSITION) & (
            np.abs(schedule.t_s[: len(flown.fed)] - 12.0) < 0.5
        )
        fixes.append(flown.fed[rows, 2, 0])
    assert len(fixes[0]) >= 4
    assert np.median(fixes[1] - fixes[0]) == pytest.approx(0.1, abs=0.03)  # down


# -- mistakes ------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ('vehicle.body.mas_kg = { distribution = "norm" }', "vehicle.body.mas_kg: no such number; known there"),
        ('propeller.mass_kg = { distribution = "norm" }', "propeller.mass_kg: no such source; known: vehicle, "),
        ('vehicle.body.mass_kg = { distribution = "gaussian" }', '"gaussian": no continuous distribution'),
        ('vehicle.body.mass_kg = { distribution = "truncnorm", a = -1 }', '"truncnorm" has the shape parameters a, b'),
        ('vehicle.body.mass_kg = { distribution = "norm", s = 1 }', '"norm" has the shape parameters none'),
        ('inertial.rate_hz = { distribution = "norm" }', "dispersion.inertial.rate_hz: is the same for all flights"),
        ('inertial.latency_s = { distribution = "norm" }', "inertial.latency_s: is the same for all flights"),
        ('vehicle.skids.cg_above_skid_m = { distribution = "norm" }', "is the same for all flights of a scenario"),
        ('gps_receiver.name = { distribution = "norm" }', "dispersion.gps_receiver.name: is no number"),
        (
            'wind.speed_20ft_m_s = { distribution = "norm", mode = "uncertainty" }',
            "the vehicle's file states none there",
        ),
    ],
)  # fmt: skip
def test_a_wrong_entry_is_one_line_that_names_it(tmp_path, entry, message):
    ready = alone(tmp_path, entry + "\n")
    with pytest.raises(InputError, match=r"^approach: dispersion\.") as error:
        ready.ensemble()
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("vehicle.body.mass_kg = { loc = 3 }", "dispersion.parameters.vehicle.body.mass_kg"),
        ('vehicle.body.mass_kg = { distribution = "norm", scale = 0 }', "scale: Input should be greater than 0"),
        ('vehicle.body.mass_kg = { distribution = "truncnorm", a = "low" }', "a shape parameter is a number"),
        ('vehicle.body.mass_kg = { distribution = "norm", mode = "times" }', "mode: Input should be 'value', 'factor'"),
        ('file = "other.toml"', "a dispersion file names no other one"),
    ],
)
def test_a_wrong_file_names_file_and_key(tmp_path, entry, message):
    with pytest.raises(InputError, match=r"none\.toml: ") as error:
        alone(tmp_path, entry + "\n")
    assert message in str(error.value)


def test_a_draw_that_cannot_be_names_flight_key_and_range(tmp_path):
    ready = alone(tmp_path, 'vehicle.body.mass_kg = { distribution = "norm", loc = -3, scale = 0.1 }\n')
    with pytest.raises(InputError, match=r"approach: dispersion, flight 7: vehicle\.body: mass_kg: .* than 0\.2"):
        ready.ensemble().truths(1, 7, 1)


# -- what ships ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenarios_disperse_the_vehicle_the_wind_and_every_sensor(name):
    ensemble = assemble(load_scenario(name)).ensemble()
    sources = {entry.partition(".")[0] for entry in ensemble.entries}
    wanted = {"vehicle", "wind", "flow_camera", "flow_sensor", "inertial", "gps_receiver", "range_sensor"}
    assert wanted <= sources
    assert ("pad_camera" in sources) == (name in ("approach", "sortie"))
    truths = ensemble.truths(1, 0, 200)
    assert all(isinstance(truth, Truth) for truth in truths)
    assert len({truth.vehicle.mass_kg for truth in truths}) == 200


def test_every_shipped_entry_has_its_provenance():
    """A source beside it, or the uncertainty that the vehicle's file states with its own source."""
    text = shipped("dispersion.toml").read_text(encoding="utf-8")
    entries = load_scenario("approach").dispersion.entries()
    assert len(entries) == text.count("distribution = ")
    assert all(isinstance(entry, Distribution) for entry in entries.values())
    for name, entry in entries.items():
        assert entry.source or entry.mode == "uncertainty", name


def test_a_scenarios_own_entry_stands_above_the_files():
    ready = setup(
        "approach", dispersion={"parameters": {"vehicle.body.mass_kg": {"distribution": "uniform", "loc": 9.0}}}
    )
    values = ready.ensemble().values(1, 0, 50)
    assert min(values["vehicle.body.mass_kg"]) >= 9.0
    assert len(values) == len(setup("approach").ensemble().entries)
