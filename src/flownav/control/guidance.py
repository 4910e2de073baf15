"""Guidance: the commanded path of the helicopter; and going around: when a landing is broken off, and tried again.

The path is one of knots in the local NED frame relative to the pad: position (0, 0, 0) is the ground at the pad's
centre, so `down` is minus the height of the skids. Between knots the reference moves in straight lines at constant
speed, and through a knot at constant acceleration: a corner that no vehicle can fly is one that it overshoots. A
landing keeps descending past the ground until the skids report contact.

A landing goes on while the vehicle knows where its pad is and is over it. It is broken off, and the vehicle climbs over
where it takes the pad to be, when the camera loses the pad from a height from which it should be seen, or has not found
it after a search; when the navigator no longer knows its place well enough, or suspects a fault of its sensors out of
the pad's sight; when the last metre's gate stays shut; and, below the gate, when it drifts. Aloft it waits until all is
well, and comes down again; without a camera that could help it for so long only, as no battery lasts for ever, and so
often only: then it lands with what it has. A vehicle that must find its pad with a camera never lands without having
found it, over ground that its range knows.

Last: the point that is brought over the pad, and the gate before the touchdown.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.control.gains import AutopilotGains
from flownav.core.compile import clamp, cos, equation, larger, sin, smaller
from flownav.core.frames import Rotation, heading_cosine_sine

PIECES = 8  # chosen: a corner of 1.5 s in steps of 0.2 s
LEFT_STRAIGHT = 0.9  # chosen: short legs keep a tenth of themselves (test_autopilot)


class Path(NamedTuple):
    """Knots: t_s (k,) strictly increasing, position_ned_m (k, 3). Before the first and after the last: held."""

    t_s: NDArray[np.float64]
    position_ned_m: NDArray[np.float64]


class Reference(NamedTuple):
    """Position [m] and velocity [m/s] in the local NED frame."""

    pos_n: float
    pos_e: float
    pos_d: float
    vel_n: float
    vel_e: float
    vel_d: float


@equation
def reference_at(path: Path, t_s: float) -> Reference:
    """The reference at time t: linear between knots, velocity the slope of the leg."""
    t, position = path.t_s, path.position_ned_m
    last = len(t) - 1
    leg = 0
    for k in range(1, last):
        leg = k if t_s >= t[k] else leg
    span = t[leg + 1] - t[leg]
    inside = t_s >= t[0] and t_s < t[last]
    share = min(1.0, max(0.0, (t_s - t[leg]) / span))
    rate = 1.0 / span if inside else 0.0
    step_n = position[leg + 1, 0] - position[leg, 0]
    step_e = position[leg + 1, 1] - position[leg, 1]
    step_d = position[leg + 1, 2] - position[leg, 2]
    return Reference(
        position[leg, 0] + share * step_n,
        position[leg, 1] + share * step_e,
        position[leg, 2] + share * step_d,
        rate * step_n,
        rate * step_e,
        rate * step_d,
    )


def path_through(knots: list[tuple[float, float, float, float]]) -> Path:
    """A path through (t_s, north_m, east_m, down_m) knots. ValueError unless two or more, times increasing."""
    table = np.asarray(knots, float).reshape(-1, 4)
    if len(table) < 2 or not np.all(np.diff(table[:, 0]) > 0.0):
        raise ValueError("a path needs two or more knots with strictly increasing times")
    return Path(np.ascontiguousarray(table[:, 0]), np.ascontiguousarray(table[:, 1:]))


def rounded(path: Path, blend_s: float) -> Path:
    """The path with every inner knot passed at constant acceleration over `blend_s`, in PIECES straight pieces.

    A leg is left for its corners nine tenths of its time at most. It is what averaging the path over that time gives:
    ahead of the corner by half of it, behind by as much, and on the legs between as before.
    """
    t, position = path.t_s, path.position_ned_m
    slopes = np.diff(position, axis=0) / np.diff(t)[:, None]
    times, places = [t[:1]], [position[:1]]
    for k in range(1, len(t) - 1):
        span = min(blend_s, LEFT_STRAIGHT * (t[k] - t[k - 1]), LEFT_STRAIGHT * (t[k + 1] - t[k]))
        before = np.linspace(-0.5 * span, 0.5 * span, PIECES + 1)[:, None]
        bend = (slopes[k] - slopes[k - 1]) * (before + 0.5 * span) ** 2 / (2.0 * span)
        times.append(t[k] + before[:, 0])
        places.append(position[k] + slopes[k - 1] * before + bend)
    times.append(t[-1:])
    places.append(position[-1:])
    return Path(np.ascontiguousarray(np.concatenate(times)), np.ascontiguousarray(np.concatenate(places)))


# Chosen together, none varied alone: of 480 dispersed approaches 13 landed metres beside their pad; with going around
# and the search none does, and 2 stay aloft.
REACHED_M = 0.5  # of the height to which it climbs, and beside the pad
SEARCH_M_S = 0.8  # walking pace
SEARCH_MARGIN_M = 0.3  # above the height of the search
TOUCHING_M = 0.02  # so low the skids may touch already
SEEN_S = 1.0  # a pad that was seen so lately is in sight: ten images of the shipped camera


class Knowledge(NamedTuple):
    """Knowledge of a landing vehicle beyond its position.

    pad_found: 1 where the pad has been seen or stood upon; ground_found: 1 where a range measures the height over the
    ground, which else is that of GPS, metres off; pad_unseen_s: since the camera last saw the pad; sigma_m: of the
    position over the pad, along its worse horizontal axis; doubted: 1 where the navigator suspects a fault;
    powerless_s: for how long the speed controller has reported that the motor gives nothing.
    """

    pad_found: float
    ground_found: float
    pad_unseen_s: float
    sigma_m: float
    doubted: float
    powerless_s: float = 0.0


class GoAround(NamedTuple):
    """away: 1 while the vehicle climbs or waits aloft; times: how often it went around.

    since_s: for how long it has been in doubt, or, aloft, for how long all is well.
    """

    away: float
    times: float
    since_s: float


@equation
def seeks(known: Knowledge, away: float, height_m: float, gains: AutopilotGains) -> bool:
    """So low over the ground a vehicle that has not found its pad looks for it and goes no lower; one that has lost it
    and went around does, too.
    """
    low = away > 0.0 or (known.ground_found > 0.0 and height_m < gains.search_height_m + SEARCH_MARGIN_M)
    blind = known.pad_found == 0.0 or (away > 0.0 and unseen(known, gains))
    return blind and gains.search_height_m > 0.0 and low


@equation
def learns_first(learns: float, known: Knowledge, height_m: float, gains: AutopilotGains) -> bool:
    """A vehicle that is still learning itself waits at the height of the search, as one that looks for its pad."""
    low = known.ground_found > 0.0 and height_m < gains.search_height_m + SEARCH_MARGIN_M
    return learns > 0.0 and gains.search_height_m > 0.0 and low


@equation
def search_offset(searched_s: float, gains: AutopilotGains) -> tuple[float, float]:
    """North and east of where the pad was thought to be, after so long a search [m]: out, then round."""
    radius = smaller(SEARCH_M_S * searched_s, gains.search_radius_m)
    turned = SEARCH_M_S * searched_s / larger(gains.search_radius_m, SEARCH_MARGIN_M)
    return radius * cos(turned), radius * sin(turned)


@equation
def lost_pad(known: Knowledge, height_m: float, gains: AutopilotGains) -> bool:
    """A camera should see the pad from this height and has not for too long."""
    in_view = height_m > gains.pad_view_m and height_m < gains.search_height_m
    return in_view and known.pad_found > 0.0 and unseen(known, gains)


@equation
def unseen(known: Knowledge, gains: AutopilotGains) -> bool:
    """The camera, if there is one, has not seen the pad for too long."""
    return known.pad_unseen_s > gains.pad_lost_s


@equation
def unsure(known: Knowledge, gains: AutopilotGains) -> bool:
    """The navigator does not know its place over the pad well enough, or suspects a fault out of the pad's sight.

    In sight of the pad no sensor that fails can lead it away from there.
    """
    doubtful = (known.doubted > 0.0 and unseen(known, gains)) or not (known.sigma_m <= gains.landing_sigma_m)
    return known.pad_found > 0.0 and doubtful


@equation
def adrift(known: Knowledge, beside_m2: float, speed_m2_s2: float, height_m: float, gains: AutopilotGains) -> bool:
    """Below the gate, over a pad that it knows: too far from its middle, or too fast over the ground; both squared."""
    radius, speed = gains.drift_radius_m, gains.drift_speed_m_s
    off = beside_m2 > radius * radius or speed_m2_s2 > speed * speed
    low = height_m < gains.commit_height_m and height_m > TOUCHING_M
    return known.pad_found > 0.0 and low and off


class Approach(NamedTuple):
    """Where a landing is: distance of the skids' middle from the pad's and speed over the ground, both squared; height
    of the skids; since when it waits at the gate, or aloft, and searches; landing: flies, may land, no weight on skids.
    """

    beside_m2: float
    speed_m2_s2: float
    height_m: float
    waited_s: float
    searched_s: float
    landing: bool


@equation
def mind_landing(before: GoAround, known: Knowledge, now: Approach, gains: AutopilotGains, dt: float) -> GoAround:
    """One period of the outer loop further."""
    beside_m2, speed_m2_s2, height_m, waited_s, searched_s, landing = now
    in_doubt_s = before.since_s + dt if before.away == 0.0 and unsure(known, gains) else 0.0
    settling = height_m > gains.commit_height_m and height_m < gains.land_height_m
    shut = waited_s > gains.align_wait_s or searched_s > gains.search_wait_s
    broken = settling and (lost_pad(known, height_m, gains) or in_doubt_s > gains.doubt_s or shut)
    broken = broken or adrift(known, beside_m2, speed_m2_s2, height_m, gains)
    may = landing and gains.go_around_height_m > 0.0 and before.times < gains.go_arounds_most
    goes = before.away == 0.0 and may and broken

    level = height_m - gains.go_around_height_m
    over = level > -REACHED_M and level < REACHED_M and beside_m2 < REACHED_M * REACHED_M
    seen = gains.search_height_m == 0.0 or (known.pad_found > 0.0 and known.pad_unseen_s < SEEN_S)
    well = before.away > 0.0 and over and seen and not unsure(known, gains)
    well_s = before.since_s + dt if well else larger(before.since_s - dt, 0.0)
    tired = gains.search_height_m == 0.0 and waited_s > gains.aloft_most_s  # no camera can help it any more
    returns = before.away > 0.0 and (well_s > gains.clear_s or tired)
    away = 1.0 if goes or (before.away > 0.0 and landing and not returns) else 0.0
    return GoAround(away, before.times + 1.0 if goes else before.times, in_doubt_s if away == 0.0 else well_s)


@equation
def climb_out(height_m: float, gains: AutopilotGains) -> float:
    """Velocity down that brings the vehicle to the height at which it waits [m/s]."""
    return clamp(
        gains.height_gain * (height_m - gains.go_around_height_m), -gains.climb_limit_m_s, gains.climb_limit_m_s
    )


FELT_S = 0.2  # chosen: for this long the speed controller must report it
# chosen by the least sink at the touchdown from 3 and 10 m (control.md)
GLIDE_M_S, FLARE_1_S, FLARE_RAD = 4.0, 1.3, 0.12


@equation
def powerless(known: Knowledge) -> bool:
    """The motor gives nothing: the energy of the turning rotor must do for the landing."""
    return known.powerless_s > FELT_S


@equation
def unpowered(height_m: float, known: Knowledge) -> float:
    """Velocity down [m/s] without power: fast, as the air then turns the rotor, and braked over a ground that a range
    knows in proportion to the height that is left.
    """
    braked = FLARE_1_S * larger(height_m, 0.0)
    return smaller(GLIDE_M_S, braked) if known.ground_found > 0.0 else GLIDE_M_S


BLIND_M_S = 0.5  # chosen: what the range sensor's 3.5 m and the heave loop stop well above the ground


@equation
def sunk(vel_d: float, known: Knowledge, contact_time_s: float, landing: bool, gains: AutopilotGains) -> float:
    """Velocity down [m/s] of a landing that knows no height: on down, without regard to GPS, until a range finds the
    ground; and with weight on its skids, that a gate or a wrong height does not lift it again.
    """
    blind = landing and known.ground_found == 0.0 and gains.search_height_m > 0.0
    down = larger(vel_d, BLIND_M_S) if blind else vel_d
    return larger(down, smaller(gains.land_speed_m_s, gains.climb_limit_m_s)) if contact_time_s > 0.0 else down


FORESEEN_S = 1.0  # how far ahead the last metre's gate looks: chosen, not measured; that it looks, test_autopilot holds


@equation
def skids_beside(rotation: Rotation, gains: AutopilotGains) -> tuple[float, float]:
    """How far the middle of the skids hangs north and east of the centre of gravity in trimmed hover [m].

    A helicopter hovers with a roll against its tail rotor and stands level: what touches the ground first, and where it
    comes to rest, is the skids.
    """
    forward = gains.skids_below_cg_m * gains.pitch_trim_sine
    left = gains.skids_below_cg_m * gains.roll_trim_sine
    cos_heading, sin_heading = heading_cosine_sine(rotation)
    return cos_heading * forward + sin_heading * left, sin_heading * forward - cos_heading * left


@equation
def misaligned(
    off_n: float, off_e: float, vel_n: float, vel_e: float, height_m: float, waited_s: float, gains: AutopilotGains
) -> bool:
    """Whether the last metre's gate is shut: the skids would not touch near enough to the pad's middle.

    off_n, off_e: from the middle of the skids to the reference [m]; vel_n, vel_e: over the ground [m/s]; height_m: of
    the skids. What counts is where the skids will be when they touch, a second ahead at most. What is near enough grows
    with the time waited, for no wind lets a vehicle wait for ever.
    """
    until_s = smaller(height_m / gains.land_speed_m_s, FORESEEN_S)
    beside_n, beside_e = off_n - until_s * vel_n, off_e - until_s * vel_e
    patience = 1.0 + waited_s / gains.align_patience_s
    radius, speed = gains.align_radius_m * patience, gains.align_speed_m_s * patience
    far = beside_n * beside_n + beside_e * beside_e > radius * radius
    fast = vel_n * vel_n + vel_e * vel_e > speed * speed
    return (far or fast) and height_m < gains.align_height_m and height_m > gains.commit_height_m


@equation
def descent_limit(waiting: bool, gate_m: float, height_m: float, vel_d: float, gains: AutopilotGains) -> float:
    """How fast the vehicle may descend [m/s]: slowly near the pad, and not at all while it waits at the gate.

    It climbs back to the height of the gate, gate_m, and waits there: gusts would else sink it through. vel_d: the
    reference's.
    """
    slow = gains.land_speed_m_s if height_m < gains.land_height_m else gains.climb_limit_m_s + vel_d
    back = clamp(gains.height_gain * (height_m - gate_m), -gains.land_speed_m_s, 0.0)
    return back if waiting else slow
