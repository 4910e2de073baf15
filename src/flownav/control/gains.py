"""The autopilot's gains and limits, as the flight kernel takes them."""

from typing import NamedTuple


class AutopilotGains(NamedTuple):
    """Gains and limits, SI; trims of the vehicle that is flown."""

    position_gain: float = 0.5  # [1/s] velocity per position error
    horizontal_speed_limit_m_s: float = 1.5
    forward_gain: float = 1.1  # [1/s] acceleration per velocity error
    forward_integral: float = 0.25  # [1/s2]
    right_gain: float = 1.1  # [1/s]
    right_integral: float = 0.25  # [1/s2]
    gust_share: float = 0.0  # of the acceleration that the disturbance observer sees, what is answered with tilt
    gust_decay_forward: float = 0.0  # of the observer's low-pass over one period of the outer loop
    gust_decay_right: float = 0.0
    tilt_limit: float = 0.35  # sine of the tilt against trim: 0.20 let 9 m/s of side wind carry it off (control.md)
    height_gain: float = 0.9  # [1/s]
    climb_limit_m_s: float = 1.5
    collective_gain: float = 0.010  # [rad/(m/s)]
    collective_integral: float = 0.008  # [rad/m]
    collective_limit_rad: float = 0.06  # about trim
    pitch_gain: float = 0.14  # [rad cyclic / tilt error]
    pitch_integral: float = 0.10  # [rad/s]
    pitch_damping: float = 0.012  # [rad/(rad/s)]
    roll_gain: float = 0.14
    roll_integral: float = 0.10
    roll_damping: float = 0.012
    cyclic_limit_rad: float = 0.12
    heading_gain: float = 1.5  # [1/s]
    into_wind_rad_s: float = 0.0  # how fast the nose goes into a wind that pushes; 0: north is held
    yaw_rate_gain: float = 0.05  # [rad/(rad/s)]
    yaw_rate_integral: float = 0.10  # [rad/rad]
    pedal_limit_rad: float = 0.20
    collective_trim_rad: float = 0.0732
    pedal_trim_rad: float = 0.16
    lon_trim_rad: float = 0.0
    lat_trim_rad: float = 0.0
    pitch_trim_sine: float = 0.0
    roll_trim_sine: float = 0.0
    idle_collective_rad: float = 0.0
    pedal_per_collective: float = 0.0  # what holds the heading against the main rotor's torque, about trim
    sink_limit_m_s: float = 1e9  # faster a rotor sinks into its own wake
    spool_rate_rad_s: float = 0.20  # how fast the collective goes down to idle after touchdown
    presses_on: float = 0.0  # 1.0: it goes down from the first touch, the attitude still held
    # the last metres of a precision landing: nothing of it where the limits are as here
    pad_pos_d_m: float = 0.0  # of the reference point when the skids touch
    skids_below_cg_m: float = 0.0  # it is their middle that is brought over the pad
    land_height_m: float = 0.0  # below it the descent is held to land_speed_m_s
    land_speed_m_s: float = 1e9
    align_height_m: float = 0.0  # below it, down to commit_height_m, no descent while farther than align_radius_m
    align_radius_m: float = 1e9
    align_speed_m_s: float = 1e9  # nor while faster than this over the ground
    align_patience_s: float = 1e9  # both double after so long a wait
    commit_height_m: float = 0.0
    search_height_m: float = 0.0  # no lower than this before the pad is found
    # going around: never where the height is 0
    go_around_height_m: float = 0.0
    go_arounds_most: float = 2.0
    pad_view_m: float = 1e9  # from here up to search_height_m the camera should see the pad
    pad_lost_s: float = 1e9
    landing_sigma_m: float = 1e9  # of the position over the pad
    doubt_s: float = 1e9  # of doubt
    align_wait_s: float = 1e9  # at the shut gate
    search_wait_s: float = 1e9
    search_radius_m: float = 0.0  # of the circle on which it looks for the pad
    drift_radius_m: float = 1e9  # below commit_height_m
    drift_speed_m_s: float = 1e9
    clear_s: float = 3.0  # so long all must be well before it comes down again
    aloft_most_s: float = 1e9  # and no longer than this does it wait for that, where no camera helps
