"""Made indoor flights (tools/made): the same bits again, physics that adds up, classes that are what they say."""

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.logs.csv_folder import read_csv_folder
from made import loop_dynamics, loop_sensors, spline_flight, spline_sensors
from made.classes import NAMES, make
from made.flight import GRAVITY_M_S2, draws, heading_of, write
from made.judging import path_length
from made.loop_flight import flown
from made.loop_traits import traits_of as loop_traits_of
from made.reckoning import rest_of
from made.spline_floor import Floor, depths
from made.spline_traits import traits_of as spline_traits_of

ONCE = {name: None for name in NAMES}


def flight(name):
    """The first flight of a class, made once."""
    ONCE[name] = ONCE[name] or make(name, 0)
    return ONCE[name]


def columns(table, what):
    return np.column_stack([table[f"{what[0]}_{axis}_{what[1]}"] for axis in "xyz"])


def gyro(made):
    return columns(made.tables["imu"], ("gyro", "rad_s"))


def accel(made):
    return columns(made.tables["imu"], ("accel", "m_s2"))


def flying(made, t_s, ends_s=3.0):
    return (t_s > made.truth.take_off_s + ends_s) & (t_s < made.truth.landing_s - ends_s)


def hz(table):
    return 1.0 / np.median(np.diff(table["t_s"]))


# -- reproducible, and a log --------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["a-mix", "b-mix"])
def test_the_same_words_make_the_same_bits_and_others_do_not(name):
    again, other = make(name, 0), make(name, 1)
    for file, table in flight(name).tables.items():
        for column, values in table.items():
            assert values.tobytes() == again.tables[file][column].tobytes()
    assert len(other.truth.t_s) != len(again.truth.t_s)


def test_no_class_has_another_name():
    with pytest.raises(KeyError):
        make("a-nonsense", 0)


@pytest.mark.parametrize("name", NAMES)
def test_every_flight_is_as_long_far_and_high_as_a_small_room_allows(name):
    truth = flight(name).truth
    assert 35.0 < truth.t_s[-1] < 68.0
    assert truth.landing_s - truth.take_off_s > 30.0
    assert 12.0 < path_length(truth) < 42.0
    assert 0.3 < -truth.pos_ned_m[:, 2].min() < 2.3


@pytest.mark.parametrize("name", ["a-baro", "b-clean", "b-px4flow"])
def test_a_folder_is_read_as_a_log_without_a_lost_row(tmp_path, name):
    made = flight(name)
    write(made, tmp_path)
    log = read_csv_folder(tmp_path)
    assert not log.notes
    assert np.allclose(log.streams[Sensor.IMU].value[:, :3], gyro(made), atol=1e-6)
    for stream in log.streams.values():
        assert stream.rejected.keys() <= {"invalid", "repeated"}
    assert len(log.truth["t_s"]) == len(made.tables["truth"]["t_s"])


# -- physics ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["a-mix", "a-yaw", "a-table", "b-mix", "b-throw", "b-landings", "b-yaw"])
def test_what_perfect_inertial_sensors_show_sums_to_the_motion(name):
    truth, step_s = flight(name).truth, 0.001
    quaternion, velocity, place = truth.quaternion[0], truth.vel_ned_m_s[0].copy(), truth.pos_ned_m[0].copy()
    for rate, force in zip(truth.rate_frd_rad_s, truth.force_frd_m_s2, strict=True):
        place += 0.5 * step_s * velocity
        turned = loop_dynamics.turned(quaternion, rate, step_s)
        middle = quaternion + turned
        velocity = velocity + step_s * (loop_dynamics.rotation(middle / np.linalg.norm(middle)) @ force)
        velocity[2] += step_s * GRAVITY_M_S2
        place += 0.5 * step_s * velocity
        quaternion = turned
    assert abs(quaternion @ truth.quaternion[-1]) == pytest.approx(1.0, abs=1e-9)
    assert np.allclose(velocity, truth.vel_ned_m_s[-1], atol=2e-3)
    assert np.allclose(place, truth.pos_ned_m[-1], atol=0.02)


@pytest.mark.parametrize("name", ["a-clean", "b-clean"])
def test_at_rest_there_is_gravity_and_nothing_else(name):
    truth = flight(name).truth
    assert np.allclose(np.linalg.norm(truth.force_frd_m_s2[:2000], axis=1), GRAVITY_M_S2, atol=2e-3)
    assert np.allclose(truth.rate_frd_rad_s[:2000], 0.0, atol=1e-4)
    assert np.allclose(truth.pos_ned_m[:2000], 0.0, atol=1e-4)


def at_rest(**changes):
    vehicle = loop_dynamics.Vehicle(
        0.1, 0.07, np.full(4, 0.05), 2.0, 0.04, np.ones(4), 0.006, 0.015, np.zeros(2), 0.3, 0.06, 0.5
    )
    return vehicle._replace(**changes)


def told(phase, count, **rows):
    nothing = {
        "phase": np.full(count, phase), "place": np.zeros((count, 3)), "yaw": np.zeros(count),
        "angle": np.zeros((count, 3)), "slip_rad_s": np.zeros(count), "wind_m_s": np.zeros((count, 3)),
        "believed": np.zeros((count, 7)), "wash": np.zeros((count, 6)),
    }  # fmt: skip
    return loop_dynamics.Told(**(nothing | rows))


def dropped(height_m, phase, steps, **rows):
    out = np.zeros((steps, loop_dynamics.COLUMNS))
    start = np.array([0.0, 0.0, -0.05 - height_m])
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    loop_dynamics.fly(at_rest(), told(phase, steps // 10 + 1, **rows), np.zeros((0, 5)), 0.0, start, upright, out)
    return out


def test_without_motors_it_falls_freely_and_then_the_floor_carries_it():
    out = dropped(0.3, loop_dynamics.OFF, 4000)
    fallen = out[:240, 2] - out[0, 2]
    assert np.allclose(fallen, 0.5 * GRAVITY_M_S2 * (np.arange(240) * 0.001) ** 2, atol=2e-3)
    energy = 0.5 * (out[:, 3:6] ** 2).sum(axis=1) - GRAVITY_M_S2 * out[:, 2]
    assert energy[-1] < energy[0]
    assert out[-1, 17] == pytest.approx(1.0, abs=1e-3)  # the feet carry its weight
    assert abs(out[-1, 3:6]).max() < 1e-4


def test_a_controller_that_knows_hovers_where_it_is_told():
    out = dropped(0.0, loop_dynamics.FLY, 9000, place=np.tile([0.2, -0.1, -0.8], (901, 1)), yaw=np.full(901, 0.5))
    assert np.allclose(out[-1, 0:3], [0.2, -0.1, -0.8], atol=0.02)
    assert heading_of(out[-1:, 6:10])[0] == pytest.approx(0.5, abs=0.02)
    assert out[-1, 13:17].sum() == pytest.approx(1.0, abs=0.02)  # thrust is weight


# -- sensors ------------------------------------------------------------------------------------------------------
def test_counts_over_a_flat_floor_follow_the_law_of_flow():
    made = spline_flight.fly(spline_traits_of("a-clean", draws("law", 0, "t")), draws("law", 0, "m"))
    floor = Floor(0.0, np.zeros((0, 5)), "plain", np.zeros((2, 6)))
    rows = np.arange(12000, 40000, 50)
    seen, texture = spline_sensors.image_motion(made, floor, rows, 0.03, np.eye(3))
    truth = made.truth
    for k, row in enumerate(rows):
        body = loop_dynamics.rotation(truth.quaternion[row])
        velocity, depth = body.T @ truth.vel_ned_m_s[row], (0.03 - truth.pos_ned_m[row, 2]) / body[2, 2]
        rate = truth.rate_frd_rad_s[row]
        assert seen[k] == pytest.approx([rate[0] - velocity[1] / depth, rate[1] + velocity[0] / depth], abs=0.02)
    assert texture.min() > 0.9


def test_the_closed_loops_flow_follows_the_law_where_its_lens_is():
    made = flown(loop_traits_of("b-clean", draws("law", 0, "t")), draws("law", 0, "m"))
    truth, lever = made.truth, np.array([0.03, -0.02, 0.01])
    turning = np.vstack([truth.rate_frd_rad_s, truth.rate_frd_rad_s[-1:]])
    rows = np.arange(12000, 40000, 50)
    seen = loop_sensors.seen_rate(made, turning, rows, lever)
    for k, row in enumerate(rows):
        body, rate = loop_dynamics.rotation(truth.quaternion[row]), turning[row]
        velocity = body.T @ truth.vel_ned_m_s[row] + np.cross(rate, lever)
        eye = truth.pos_ned_m[row] + body @ lever
        depth = (made.ground_m - eye[2]) / body[2, 2]
        assert seen[k] == pytest.approx([rate[0] - velocity[1] / depth, rate[1] + velocity[0] / depth], abs=1e-9)


def test_a_ray_from_a_tilted_vehicle_meets_a_box_where_it_is_and_not_above_it():
    floor = Floor(0.0, np.array([[0.2, 0.6, -1.0, 1.0, 0.3]]), "plain", np.zeros((2, 6)))
    pitched = np.array([[np.cos(0.15), 0.0, np.sin(0.15), 0.0]])  # nose up by 0.3 rad: it looks ahead
    along, north, _ = depths(floor, np.array([[0.0, 0.0, -1.2]]), pitched, 0.0, np.array([0.0, 0.0, 1.0]))
    assert north[0] == pytest.approx(0.9 * np.tan(0.3))
    assert along[0] == pytest.approx(0.9 / np.cos(0.3))


def test_an_askew_sensor_is_turned_by_what_is_asked():
    turn = spline_sensors._askew(np.random.default_rng(1), np.deg2rad(3.0))
    assert turn @ turn.T == pytest.approx(np.eye(3))
    assert np.rad2deg(np.arccos((np.trace(turn) - 1.0) / 2.0)) == pytest.approx(3.0)
    assert spline_traits_of("a-askew", draws("a-askew", 0, "traits")).askew_deg == (3.0, 3.0)


# -- what it says on the tin ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("letter", "ab")
def test_a_clean_flight_rests_long_and_its_line_is_good(letter):
    made = flight(f"{letter}-clean")
    rest = rest_of(made.tables["imu"]["t_s"], gyro(made), accel(made))
    assert made.tables["imu"]["t_s"][rest] > 4.0


@pytest.mark.parametrize("name", ["a-no-rest", "a-lying", "a-lying-hard", "b-no-rest", "b-lying"])
def test_a_flight_without_rest_has_none(name):
    made = flight(name)
    assert rest_of(made.tables["imu"]["t_s"], gyro(made), accel(made)) == 0
    assert made.truth.take_off_s < 3.0


@pytest.mark.parametrize("name", ["a-slip", "b-slip"])
@pytest.mark.parametrize("number", range(4))
def test_motors_turn_it_on_the_floor(name, number):
    truth = make(name, number).truth
    standing = np.rad2deg(heading_of(truth.quaternion[: round(1000 * truth.take_off_s) - 20]))
    assert 0.3 < abs(standing[-1] - standing[0]) < 3.2


@pytest.mark.parametrize("name", ["a-lying", "a-lying-hard", "b-lying"])
def test_one_axis_of_a_lying_accelerometer_is_far_off_in_flight(name):
    made, t_s = flight(name), flight(name).tables["imu"]["t_s"]
    true = made.truth.force_frd_m_s2[flying(made, made.truth.t_s[:-1])].mean(axis=0)
    off = np.sort(abs(accel(made)[flying(made, t_s)].mean(axis=0) - true))
    assert 1.7 < off[-1] < 4.5
    assert off[1] < 0.6 * off[2]


def test_strong_vibration_shakes_four_times_as_much_with_spikes():
    strong, calm = (flight(name) for name in ("a-vibration", "a-clean"))
    shaken, less = (accel(made)[flying(made, made.tables["imu"]["t_s"])].std(axis=0) for made in (strong, calm))
    assert (shaken > 2.5 * less).all()
    spikes = abs(np.diff(gyro(strong)[:, :2], axis=0)).max(axis=1) > 3.0
    assert spikes.sum() >= 4


def test_counts_are_whole_a_hundred_times_a_second():
    flow = flight("a-counts-100").tables["flow"]
    assert hz(flow) == pytest.approx(100.0, rel=0.05)
    counts = flow["flow_x_rad_s"][1:] * np.diff(flow["t_s"]) / 0.002048
    assert np.allclose(counts, np.round(counts), atol=1e-6)


@pytest.mark.parametrize(
    ("name", "sensor", "rate"),
    [
        ("a-flow-8", "flow", 8), ("a-flow-20", "flow", 20), ("b-flow-8", "flow", 8), ("b-flow-50", "flow", 50),
        ("a-imu-50", "imu", 50), ("a-imu-1000", "imu", 1000), ("b-imu-50", "imu", 50), ("b-baro", "imu", 1000),
        ("a-clean", "imu", 250), ("a-baro", "baro", 950), ("b-baro", "baro", 1000),
    ],
)  # fmt: skip
def test_sensors_have_the_rates_that_their_class_says(name, sensor, rate):
    assert hz(flight(name).tables[sensor]) == pytest.approx(rate, rel=0.04)


@pytest.mark.parametrize("name", ["a-baro", "b-baro"])
def test_a_repeated_barometer_repeats_and_is_wrong_at_first(name):
    table = flight(name).tables["baro"]
    assert np.mean(np.diff(table["alt_m"]) != 0.0) < 0.05
    settled = np.median(table["alt_m"][(table["t_s"] > 3.0) & (table["t_s"] < 5.0)])
    assert abs(table["alt_m"][0] - settled) > 2.0


@pytest.mark.parametrize("name", ["a-yaw", "b-yaw"])
def test_a_turning_flight_turns_at_a_quarter_turn_a_second(name):
    rates = np.abs(flight(name).truth.rate_frd_rad_s[:, 2])
    assert np.percentile(rates, 97.0) > 1.1
    assert np.rad2deg(rates.max()) < 160.0


@pytest.mark.parametrize("name", ["a-table", "b-table"])
def test_off_a_table_the_ground_falls_away_at_once(name):
    made = flight(name)
    metres, t_s = made.tables["range"]["range_m"], made.tables["range"]["t_s"]
    soon = (t_s > made.truth.take_off_s) & (t_s < made.truth.take_off_s + 6.0)
    assert np.diff(metres[soon]).max() > 0.3
    assert made.truth.pos_ned_m[-1, 2] > 0.4  # and it lands below where it stood


def test_a_throw_begins_in_a_hand_and_falls_before_its_motors_run():
    truth = flight("b-throw").truth
    force = np.linalg.norm(truth.force_frd_m_s2, axis=1)
    at = round(1000 * truth.take_off_s)
    assert 0.005 < truth.rate_frd_rad_s[: at - 600].std(axis=0).max() < 0.5  # a hand sways
    assert force[at : at + 200].min() < 3.0
    assert truth.pos_ned_m[-1, 2] > 0.8


def test_boxes_stand_below_the_path():
    made = flight("a-boxes")
    t_s, metres = made.tables["range"]["t_s"], made.tables["range"]["range_m"]
    height = np.interp(t_s, made.truth.t_s, -made.truth.pos_ned_m[:, 2])
    near = (height - metres)[flying(made, t_s)]
    assert 0.02 < np.mean(near > 0.06) < 0.9


@pytest.mark.parametrize("name", ["a-texture", "b-texture"])
def test_texture_is_lost_for_seconds(name):
    made = flight(name)
    flow = made.tables["flow"]
    seen = flow["t_s"][(flow["quality"] > 0.0) & flying(made, flow["t_s"])]
    assert 0.9 < np.diff(seen).max() < 8.0


def test_tiles_are_poorer_in_texture_than_a_carpet():
    tiles, carpet = (flight(f"a-{name}").tables["flow"]["quality"] for name in ("tiles", "carpet"))
    assert np.percentile(tiles, 25.0) < np.percentile(carpet, 25.0) - 20.0


@pytest.mark.parametrize("name", ["a-sticking", "b-sticking"])
def test_a_sticking_range_repeats_itself_in_flight(name):
    made = flight(name)
    table = made.tables["range"]
    changed = table["t_s"][1:][(np.diff(table["range_m"]) != 0.0)]
    assert np.diff(changed[flying(made, changed)]).max() > 0.4


def test_dropouts_silence_a_sensor():
    tables = flight("b-dropouts").tables
    assert np.diff(tables["imu"]["t_s"]).max() > 0.02
    assert max(np.diff(tables[name]["t_s"]).max() for name in ("flow", "range")) > 0.3


@pytest.mark.parametrize("name", ["a-temperature", "b-temperature"])
def test_a_warming_gyro_drifts(name):
    made = flight(name)
    t_s, truth = made.tables["imu"]["t_s"], made.truth
    whole = [np.concatenate([[0.0], np.cumsum(column) * 0.001]) for column in truth.rate_frd_rad_s.T]
    summed = np.cumsum(gyro(made) * np.gradient(t_s)[:, None], axis=0)
    off = summed - np.column_stack([np.interp(t_s, truth.t_s, column) for column in whole])
    means = [(off[t_s <= end][-1] - off[t_s >= begin][0]) / (end - begin) for begin, end in ((0.2, 3.0), (35.0, 45.0))]
    assert abs(means[1] - means[0]).max() > 0.0015


@pytest.mark.parametrize("letter", "ab")
def test_a_soft_mount_keeps_fast_vibration_away(letter):
    fast = [
        np.diff(accel(made)[flying(made, made.tables["imu"]["t_s"])], axis=0).std(axis=0)
        for made in (flight(f"{letter}-soft-mount"), flight(f"{letter}-clean"))
    ]
    assert np.median(fast[0] / fast[1]) < 0.7


def test_landings_come_down_three_times():
    made = flight("b-landings")
    low = (made.truth.pos_ned_m[:, 2] > -0.02) & (made.truth.t_s > made.truth.take_off_s + 2.0)
    change = np.flatnonzero(np.diff(low.astype(int), append=0))
    stood_s = made.truth.t_s[change[1::2]] - made.truth.t_s[change[::2]]
    assert np.count_nonzero(stood_s > 0.6) == 3


def test_a_sonar_says_its_least_on_the_ground():
    made = flight("b-sonar")
    table = made.tables["range"]
    assert set(table["range_m"][table["t_s"] < made.truth.take_off_s - 2.0]) == {0.3}


def test_the_metric_flow_is_px4flows_message():
    tables = flight("b-px4flow").tables
    assert tables.keys() == {"imu", "px4flow", "truth", "heading_truth"}
    assert tables["px4flow"]["ground_distance_m"].min() == pytest.approx(0.3)


def test_a_high_flight_is_high_and_gusts_push():
    assert -flight("a-high").truth.pos_ned_m[:, 2].min() > 1.4
    calm, pushed = (loop_traits_of(name, None).wind_m_s for name in ("b-clean", "b-gusts"))
    assert pushed[0] > 2.0 * calm[1]
