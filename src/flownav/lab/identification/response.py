"""The response of an all-pole model to a logged input, and its exact derivatives, at the log's own times.

    y(t) = x(t - T) + y0,    x^(n) + a_1 x^(n-1) + ... + a_n x = K a_n u(t)

K is the gain at rest, T a pure delay. The input is linear between its samples (first-order hold) or kept until
the next one (zero-order hold). State, sensitivities and input form one linear system without input,

    z = (x, x', .., q, q', .., u, u'),   q^(n) + a_1 q^(n-1) + .. + a_n q = -x,   q(0) = 0

so one step is z <- exp(M h) z, exact whatever h is. The exponential is computed once for each distinct step of
a log (logs keep few), or summed as a series at each step of a log that has many. Readings between input samples,
which is what a delay makes of all of them, are reached by a step of their own.

Derivatives (Goodwin and Payne 1977, section 5.3): x by a_{n-j} is q^(j) less its free response, since q's
derivatives solve the same equation driven by -x^(j); x by the initial state is the free response; y by T is
-dy/dt. No finite difference is taken anywhere.

Inside, time is scaled by the model's own rate a_n^(1/n), which makes a_n one and M well balanced.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation, exp, kernel
from flownav.core.measurement import Array
from flownav.lab.identification.experiment import Grid, Steps

LARGEST_SERIES = 0.7  # |M h| of one series; a longer step is done in parts
SMALLEST_FREE = 1e-14  # below this the start is forgotten
SERIES_TERMS = 15  # 0.7^15/15! = 4e-15

Order = tuple[int, ...]  # (0,) * n: an order whose length is part of its type, so that kernels are built for it


@equation
def _apply(z: Array, of: Order, a: Array, held: bool, out: Array) -> None:
    """out = M z in scaled time; a (n,): a_1 .. a_n, scaled."""
    order = len(of)
    q, u = order, 2 * order
    drive_x, drive_q = z[u], -z[0]
    for i in range(order):
        drive_x -= a[order - 1 - i] * z[i]
        drive_q -= a[order - 1 - i] * z[q + i]
    for i in range(order - 1):
        out[i] = z[i + 1]
        out[q + i] = z[q + i + 1]
    out[order - 1] = drive_x
    out[q + order - 1] = drive_q
    out[u] = 0.0 if held else z[u + 1]
    out[u + 1] = 0.0


@equation
def _apply_free(row: Array, of: Order, a: Array, out: Array) -> None:
    """out = row A: the free response's first row, advanced from the right."""
    order = len(of)
    for i in range(order):
        out[i] = (row[i - 1] if i > 0 else 0.0) - a[order - 1 - i] * row[order - 1]


@kernel
def _advance(z: Array, h: float, of: Order, a: Array, held: bool, work: Array) -> None:
    """z <- exp(M h) z by its series, in as many parts as keep |M h| small."""
    size = 1.0 + np.sum(a)
    parts = max(1, int(np.ceil(size * abs(h) / LARGEST_SERIES)))
    term, following = work[0], work[1]
    for _ in range(parts):
        for i in range(len(z)):
            term[i] = z[i]
        for k in range(1, SERIES_TERMS):
            _apply(term, of, a, held, following)
            for i in range(len(z)):
                term[i] = following[i] * (h / (parts * k))
                z[i] += term[i]


@kernel
def _advance_free(row: Array, h: float, of: Order, a: Array, work: Array) -> None:
    """row <- row exp(A h), as `_advance`."""
    order = len(of)
    size = 1.0 + np.sum(a)
    parts = max(1, int(np.ceil(size * abs(h) / LARGEST_SERIES)))
    term, following = work[0], work[1]
    for _ in range(parts):
        for i in range(order):
            term[i] = row[i]
        for k in range(1, SERIES_TERMS):
            _apply_free(term, of, a, following)
            for i in range(order):
                term[i] = following[i] * (h / (parts * k))
                row[i] += term[i]


@kernel
def _matrices(steps: Steps, rate: float, of: Order, a: Array, held: bool, work: Array) -> Array:
    """exp(M h) of each distinct step, (s, k, k)."""
    width = 2 * len(of) + 2
    matrices = np.zeros((len(steps.distinct_s), width, width))
    column = np.zeros(width)
    for s in range(len(matrices)):
        for j in range(width):
            column[:] = 0.0
            column[j] = 1.0
            _advance(column, steps.distinct_s[s] * rate, of, a, held, work)
            matrices[s, :, j] = column
    return matrices


@equation
def _move(z: Array, matrices: Array, kind: int, of: Order, moved: Array) -> None:
    """z <- exp(M h) z by its matrix; x does not depend on q."""
    order = len(of)
    for i in range(order):
        total = matrices[kind, i, 2 * order] * z[2 * order] + matrices[kind, i, 2 * order + 1] * z[2 * order + 1]
        for j in range(order):
            total += matrices[kind, i, j] * z[j]
        moved[i] = total
    for i in range(order, 2 * order):
        total = matrices[kind, i, 2 * order] * z[2 * order] + matrices[kind, i, 2 * order + 1] * z[2 * order + 1]
        for j in range(2 * order):
            total += matrices[kind, i, j] * z[j]
        moved[i] = total
    for i in range(2 * order):
        z[i] = moved[i]
    z[2 * order] += matrices[kind, 2 * order, 2 * order + 1] * z[2 * order + 1]


@equation
def _move_free(row: Array, matrices: Array, kind: int, of: Order, moved: Array) -> None:
    """row <- row exp(A h) by the same matrix."""
    for j in range(len(of)):
        moved[j] = 0.0
        for i in range(len(of)):
            moved[j] += row[i] * matrices[kind, i, j]
    for j in range(len(of)):
        row[j] = moved[j]


@equation
def _feed(z: Array, t_u: Array, u: Array, at: int, order: int, rate: float, gain: float, held: bool) -> None:
    """The input and its slope from an input sample on."""
    z[2 * order] = gain * u[at]
    z[2 * order + 1] = 0.0
    if not held and at + 1 < len(u):
        z[2 * order + 1] = gain * (u[at + 1] - u[at]) / ((t_u[at + 1] - t_u[at]) * rate)


@kernel
def _free_parts(order: int, a: Array, z: Array) -> Array:
    """(n, n): row j the initial state of q^(j), which its free response has to be taken off for."""
    high = np.zeros(2 * order)  # q^(m) at the start
    for m in range(order - 1):
        value = -z[m]
        for i in range(1, m + 1):
            value -= a[i - 1] * high[order + m - i]
        high[order + m] = value
    parts = np.zeros((order, order))
    for j in range(order):
        parts[j] = high[j : j + order]
    return parts


@equation
def _account(columns: Array, row: int, sums: Array) -> None:
    """Add a row's products to the lower triangle of the sums; a start that is forgotten has only zeros."""
    for i in range(sums.shape[0]):
        value = columns[row, i]
        if value != 0.0:
            for j in range(i + 1):
                sums[i, j] += value * columns[row, j]


@kernel
def _mirror(sums: Array) -> None:
    for i in range(len(sums)):
        for j in range(i):
            sums[j, i] = sums[i, j]


class Input(NamedTuple):
    """Samples of the input (n,) at their instants [s]; held: constant from one to the next, not in a straight line."""

    t_u: Array
    u: Array
    held: bool


class Tried(NamedTuple):
    """A model: log a_1 .. log a_n, gain, whether its delay is sought.

    own (n + 1,): x, x', .. at the first input sample, in the output's unit and its rates, then the offset.
    """

    coefficients: Array
    gain: float
    with_delay: bool
    own: Array


@kernel
def response(of: Order, given: Input, grid: Grid, tried: Tried, y: Array, columns: Array, sums: Array) -> None:
    """Derivatives of the model's output at the readings of a grid, its error, and all their products.

    y (m,): the readings. Columns: by log a_1 .. log a_n, gain, delay [s] (where with_delay), start and offset; then y
    less the output. columns: (m, k) takes them all, (1, k) only the last. sums (k, k), zero on entry: columns' columns.
    """
    t_u, u, held = given
    coefficients, gain, with_delay, own = tried
    order = len(of)
    rate = exp(coefficients[order - 1] / order)
    a, unit, power = np.empty(order), np.empty(order), 1.0
    for i in range(order):
        unit[i] = power
        power = power / rate
        a[i] = exp(coefficients[i]) * power
    width = 2 * order + 2
    work = np.zeros((2, width))
    between = _matrices(grid.between, rate, of, a, held, work)
    past = _matrices(grid.past, rate, of, a, held, work)
    z, now, moved = np.zeros(width), np.zeros(width), np.zeros(width)
    free, free_now = np.zeros(order), np.zeros(order)
    free[0] = 1.0
    for i in range(order):
        z[i] = own[i] * unit[i]
    first = z[:order].copy()
    parts = _free_parts(order, a, first)
    sample, between_s, between_kind = grid.sample, grid.between.length_s, grid.between.kind
    past_s, past_kind = grid.past.length_s, grid.past.kind
    between_tabled, past_tabled = len(between) > 0, len(past) > 0
    whole, last = len(columns) > 1, columns.shape[1] - 1
    begin = order + 2 if with_delay else order + 1
    at, alive = 0, True
    _feed(z, t_u, u, at, order, rate, gain, held)
    for row in range(len(y)):
        at_row = row if whole else 0
        while at < sample[row]:
            if between_tabled:
                _move(z, between, between_kind[at], of, moved)
                if alive:
                    _move_free(free, between, between_kind[at], of, moved)
            else:
                _advance(z, between_s[at] * rate, of, a, held, work)
                if alive:
                    _advance_free(free, between_s[at] * rate, of, a, work)
            alive = alive and np.abs(free).max() > SMALLEST_FREE
            at += 1
            _feed(z, t_u, u, at, order, rate, gain, held)
        for i in range(width):
            now[i] = z[i]
        for i in range(order):
            free_now[i] = free[i] if alive else 0.0
        if past_s[row] != 0.0:
            if past_tabled:
                _move(now, past, past_kind[row], of, moved)
                if alive:
                    _move_free(free_now, past, past_kind[row], of, moved)
            else:
                _advance(now, past_s[row] * rate, of, a, held, work)
                if alive:
                    _advance_free(free_now, past_s[row] * rate, of, a, work)
        forced = now[0]
        for j in range(order):
            columns[at_row, order - 1 - j] = a[order - 1 - j] * now[order + j]
            columns[at_row, begin + j] = 0.0
        if alive:
            for i in range(order):
                forced -= free_now[i] * first[i]
                columns[at_row, begin + i] = free_now[i] * unit[i]
                for j in range(order):
                    columns[at_row, order - 1 - j] -= a[order - 1 - j] * free_now[i] * parts[j, i]
        columns[at_row, order - 1] += forced
        columns[at_row, order] = forced / gain
        if with_delay:
            slope = now[1] if order > 1 else now[2 * order] - a[0] * now[0]
            columns[at_row, order + 1] = -rate * slope
        columns[at_row, last - 1] = 1.0
        columns[at_row, last] = y[row] - now[0] - own[order]
        _account(columns, at_row, sums)
    _mirror(sums)


@kernel
def delayed(given: Input, grid: Grid, gain: float, offset: float, y: Array, columns: Array, sums: Array) -> None:
    """The response of a model without dynamics, y(t) = K u(t - T) + y0; columns: gain, delay, offset, error."""
    t_u, u, held = given
    for row in range(len(y)):
        at, at_row = grid.sample[row], row if len(columns) > 1 else 0
        slope = 0.0
        if not held and at + 1 < len(u):
            slope = (u[at + 1] - u[at]) / (t_u[at + 1] - t_u[at])
        value = u[at] + slope * grid.past.length_s[row]
        columns[at_row, 0] = value
        columns[at_row, 1] = -gain * slope
        columns[at_row, 2] = 1.0
        columns[at_row, 3] = y[row] - gain * value - offset
        _account(columns, at_row, sums)
    _mirror(sums)
