"""The simulated response and its derivatives: against SciPy, against differences, at any times."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from flownav.core.errors import InputError
from flownav.lab.identification.descent import DELAY_RANGE_S, Point, Structure, linearise
from flownav.lab.identification.experiment import MOST_STEPS, distinct_steps, experiment, lay_grid
from flownav.lab.identification.output_error import fit, simulate
from flownav.lab.identification.quantities import cross_validation

POLES = (14.0, 9.0, 20.0, 30.0)


def run(count=300, jitter=0.0, seed=0, offset_s=0.0):
    """Input at (n,) times, readings at their own; the readings' values do not matter."""
    random = np.random.default_rng(seed)
    t_u = np.arange(count) * 0.01 + jitter * random.uniform(-0.4, 0.4, count) * 0.01
    u = np.sin(3.0 * t_u) + 0.3 * np.sin(20.0 * t_u) + 0.2
    t_y = t_u[20:] + offset_s
    return experiment("run", t_u, u, t_y, np.sin(t_y))


def point(order, gain=1.05, delay_s=0.0):
    return Point(np.log(np.poly(-np.array(POLES[:order]))[1:]), gain, delay_s)


def output(record, structure, at, own):
    return record.y - linearise(record, structure, at, own, whole=True).columns[:, -1]


@pytest.mark.parametrize("held", [False, True], ids=["straight lines", "held"])
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_the_response_is_scipys(order, held):
    record = run()
    at = point(order)
    a = np.exp(at.log_a)
    expected = signal.lsim(([at.gain * a[-1]], [1.0, *a]), record.u, record.t_u, interp=not held)[1]
    got = output(record, Structure(order, held=held), at, np.zeros(order + 1))
    np.testing.assert_allclose(got, expected[20:], atol=1e-12)


def test_a_start_and_an_offset_are_the_free_response_of_scipy():
    record, at = run(), point(2)
    a = np.exp(at.log_a)
    system = signal.StateSpace([[0.0, 1.0], [-a[1], -a[0]]], [[0.0], [at.gain * a[1]]], [[1.0, 0.0]], [[0.0]])
    expected = signal.lsim(system, record.u, record.t_u, X0=[0.4, -3.0])[1]
    got = output(record, Structure(2), at, np.array([0.4, -3.0, 0.07]))
    np.testing.assert_allclose(got, expected[20:] + 0.07, atol=1e-12)


def test_readings_between_input_samples_are_those_of_a_finer_input():
    """Straight lines between samples stay the same lines on a grid ten times as fine."""
    coarse, at = run(offset_s=0.0037), point(3, delay_s=0.0213)
    t_fine = np.linspace(coarse.t_u[0], coarse.t_u[-1], 10 * (len(coarse.t_u) - 1) + 1)
    fine = experiment("fine", t_fine, np.interp(t_fine, coarse.t_u, coarse.u), coarse.t_y, coarse.y)
    own = np.array([0.1, 0.5, -2.0, 0.0])
    structure = Structure(3, delay=True)
    inside = coarse.t_y < coarse.t_u[-1]
    np.testing.assert_allclose(output(coarse, structure, at, own)[inside], output(fine, structure, at, own)[inside],
                               atol=1e-11)  # fmt: skip


def test_a_delay_shifts_the_response_in_time():
    record = run(count=600)
    at = point(2)
    shifted = experiment("late", record.t_u, record.u, record.t_y + 0.125, record.y)
    late = Point(at.log_a, at.gain, 0.125)
    own = np.zeros(3)
    np.testing.assert_allclose(
        output(shifted, Structure(2, delay=True), late, own),
        output(record, Structure(2, delay=True), at, own),
        atol=1e-11,
    )


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_steps_from_a_table_and_by_series_give_the_same(order):
    """Irregular times that are few enough for a table, and the same log with the table taken away."""
    record, at = run(offset_s=0.004), point(order, delay_s=0.0113)
    assert len(record.between.distinct_s)
    series = experiment("series", record.t_u, record.u, record.t_y, record.y)
    object.__setattr__(series, "between", record.between._replace(distinct_s=np.zeros(0)))
    own = np.linspace(0.3, -0.2, order + 1)
    structure = Structure(order, delay=True)
    one, other = (linearise(r, structure, at, own, whole=True).columns for r in (record, series))
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11)


@settings(max_examples=25, deadline=None)
@given(
    order=st.integers(1, 4), jitter=st.sampled_from([0.0, 1.0]), delay_s=st.floats(-0.05, 0.15), seed=st.integers(0, 99)
)
def test_derivatives_are_those_of_differences(order, jitter, delay_s, seed):
    record = run(count=120, jitter=jitter, seed=seed, offset_s=0.0021)
    random = np.random.default_rng(seed)
    at = point(order, gain=0.9, delay_s=delay_s)
    at = Point(at.log_a + random.uniform(-0.3, 0.3, order), at.gain, at.delay_s)
    own = random.normal(size=order + 1) * np.array([*(10.0 ** np.arange(order)), 0.1])
    structure = Structure(order, delay=True)
    columns = linearise(record, structure, at, own, whole=True).columns
    values = np.concatenate([at.log_a, [at.gain, at.delay_s], own])

    def at_values(v):
        return output(record, structure, Point(v[:order], float(v[order]), float(v[order + 1])), v[order + 2 :])

    for i in range(len(values)):
        step = 1e-6 * max(1.0, abs(values[i]))
        up, down = values.copy(), values.copy()
        up[i] += step
        down[i] -= step
        slope = (at_values(up) - at_values(down)) / (2.0 * step)
        scale = max(float(np.abs(columns[:, i]).max()), 1e-9)
        if i == order + 1 and order == 1:
            # the first order's rate jumps where the input has a corner: a difference may straddle one
            assert np.median(np.abs(slope - columns[:, i])) < 1e-5 * scale
        else:
            assert np.max(np.abs(slope - columns[:, i])) < 2e-5 * scale


def test_products_alone_are_those_of_the_whole_columns():
    record, at = run(jitter=1.0), point(2)
    whole = linearise(record, Structure(2), at, np.array([0.1, 0.2, 0.3]), whole=True)
    brief = linearise(record, Structure(2), at, np.array([0.1, 0.2, 0.3]))
    assert brief.columns.shape[0] == 1
    np.testing.assert_allclose(brief.products, whole.products, rtol=1e-12)


@pytest.mark.parametrize(("steps", "tabled"), [(MOST_STEPS, True), (MOST_STEPS + 1, False)])
def test_a_log_of_few_distinct_steps_is_tabled(steps, tabled):
    lengths = np.tile(np.linspace(0.01, 0.02, steps), 3)
    found = distinct_steps(lengths)
    assert (len(found.distinct_s) > 0) is tabled
    if tabled:
        np.testing.assert_allclose(found.distinct_s[found.kind], lengths, atol=1e-10)


@settings(max_examples=50, deadline=None)
@given(delay_s=st.floats(*DELAY_RANGE_S), seed=st.integers(0, 999))
def test_a_grid_puts_each_reading_after_its_input_sample(delay_s, seed):
    t_u = np.sort(np.random.default_rng(seed).uniform(0.0, 3.0, 50))
    t_y = np.sort(np.random.default_rng(seed + 1).uniform(t_u[0] + 0.7, 2.5, 30))
    grid = lay_grid(t_u, t_y, delay_s, distinct_steps(np.diff(t_u)))
    np.testing.assert_allclose(t_u[grid.sample] + grid.past.length_s, t_y - delay_s, atol=1e-9)
    assert np.all(grid.past.length_s >= -1e-9)
    nearer = np.minimum(grid.sample + 1, len(t_u) - 1)
    assert np.all((t_u[nearer] > t_y - delay_s) | (nearer == len(t_u) - 1))


def test_a_model_too_stiff_to_tell_from_none_has_no_cost():
    part = linearise(run(), Structure(2), Point(np.log([1e6, 1e12]), 1.0, 0.0), np.zeros(3))
    assert np.isinf(part.products).all()


# -- runs --------------------------------------------------------------------------------------------------
def data(**changes):
    t_s = np.arange(200) * 0.02
    columns = {"t_u": t_s, "u": np.sin(t_s), "t_y": t_s, "y": np.cos(t_s)} | changes
    return experiment("log", **columns)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"y": np.zeros(5)}, "log: sensor: 200 times and 5 values; one time a value is needed"),
        ({"t_u": np.arange(3.0), "u": np.arange(3.0)}, "log: 3 reference readings; at least 50 are needed"),
        ({"y": np.full(200, np.nan)}, "log: sensor: a time or value is not a number; remove such rows"),
        ({"t_y": np.zeros(200)}, "log: sensor: time does not increase after 0 s; sort and remove repeats"),
        ({"u": np.full(200, 0.5)}, "log: the reference's velocity is constant (0.5 m/s); a run that moves is needed"),
        ({"y": np.zeros(200)}, "log: the sensor's velocity is constant (0 m/s); a run that moves is needed"),
    ],
)
def test_a_run_that_cannot_serve_is_one_line(changes, message):
    with pytest.raises(InputError) as error:
        data(**changes)
    assert str(error.value).startswith(message)


def test_readings_outside_the_references_time_are_refused():
    t_s = np.arange(200) * 0.02
    with pytest.raises(InputError, match="0 sensor readings lie inside the reference's time; at least 50 are needed"):
        fit([data(t_y=t_s + 100.0)], Structure(0))


def test_readings_that_move_only_outside_the_references_reach_are_refused():
    t_s, y = np.arange(90) * 0.1, np.zeros(90)
    y[:2] = 1e6, -3.0  # before the longest delay has passed
    for order in range(3):
        with pytest.raises(InputError, match="velocity is constant"):
            fit([experiment("log", t_s, np.sin(t_s), t_s, y)], Structure(order))


@settings(max_examples=30, deadline=None)
@given(
    values=st.lists(st.floats(-1e6, 1e6), min_size=60, max_size=90),
    steps=st.lists(st.floats(1e-4, 0.5), min_size=60, max_size=90),
    order=st.integers(0, 2),
)
def test_any_finite_data_give_a_model_or_one_line(values, steps, order):
    count = min(len(values), len(steps))
    t_s, y = np.cumsum(steps[:count]), np.array(values[:count])
    try:
        found = fit([experiment("log", t_s, np.sin(t_s), t_s, y)], Structure(order))
    except InputError as error:
        message = str(error)
    else:
        message = ""
        assert np.isfinite(found.point.gain)
        assert np.isfinite(found.covariance).all()
        assert found.fit_percent <= 100.0
    assert "\n" not in message


def hardly_moved(which):
    """Runs that say nothing of a delay, or of anything: times [s], input, reading, structure."""
    t_s = 0.1 * np.arange(1, 81)
    wandering = np.cumsum(np.random.default_rng(4).standard_normal(80))
    once = np.where(np.arange(80) == 78, 1.5, 0.0)
    about_a_million = 1e6 + 1e-4 * np.random.default_rng(1).standard_normal(80)
    return {
        "a held input, which no small delay changes": (t_s, 0.2 * np.arange(80), wandering, Structure(0, held=True)),
        "an input that moves when all is read": (t_s, once, wandering, Structure(0, held=True)),
        "an input of nearly no spread": (t_s, about_a_million, 1.0 + 0.03 * (t_s > 7.0), Structure(0, held=True)),
        "an input that moves once, before the readings": (t_s, 1e-5 * (t_s > 0.15), wandering, Structure(0)),
    }[which]


@pytest.mark.parametrize(
    "which",
    [
        "a held input, which no small delay changes",
        "an input that moves when all is read",
        "an input of nearly no spread",
        "an input that moves once, before the readings",
    ],
)
def test_what_hardly_moved_gives_a_model_that_knows_it_and_no_warning(which):
    t_s, u, y, structure = hardly_moved(which)
    found = fit([experiment("log", t_s, u, t_s, y)], structure)
    assert np.isfinite(found.covariance).all()
    assert (np.diag(found.covariance) >= np.diag(found.white_covariance)).all()
    assert found.covariance.max() > 1e3  # the stated delay is not known


# -- held-out data -------------------------------------------------------------------------------------------
def known(seed, noise=0.02, gain=1.1, count=1500):
    t_s = np.arange(count) * 0.01
    u = sum(size * np.sin(2.0 * np.pi * hertz * t_s) for size, hertz in ((0.2, 0.3), (0.15, 1.1), (0.1, 2.7)))
    y = signal.lsim(([gain * 200.0], [1.0, 15.0, 200.0]), u, t_s)[1]
    return experiment(f"run {seed}", t_s, u, t_s, y + noise * np.random.default_rng(seed).standard_normal(count))


def test_held_out_runs_fit_as_well_as_their_noise_allows():
    runs = [known(seed) for seed in range(4)]
    model = fit(runs, Structure(2))
    unseen = cross_validation(runs, model)
    assert len(unseen) == 4
    np.testing.assert_allclose(unseen, model.fit_percent, atol=1.0)


def test_a_run_of_another_sensor_shows_as_unseen():
    runs = [known(seed) for seed in range(3)] + [known(9, gain=2.2)]
    unseen = cross_validation(runs, fit(runs, Structure(2)))
    assert unseen[3] < min(unseen[:3]) - 10.0


def test_a_single_run_is_validated_on_its_last_third():
    run_alone = known(1, count=4000)
    (unseen,) = cross_validation([run_alone], fit([run_alone], Structure(2)))
    assert 80.0 < unseen < 100.0


def test_simulation_starts_where_the_run_does():
    """The start of a run is estimated, so a model simulated on other data is not blamed for it."""
    record = known(3, noise=0.0)
    later = record.from_input(500).between_times(6.0, np.inf)
    model = fit([record], Structure(2))
    np.testing.assert_allclose(simulate(later, model.structure, model.point), later.y, atol=1e-4)
