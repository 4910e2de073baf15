"""A second helicopter for the tests: the MIT X-Cell .60 of Gavrilets, as far as its numbers are public."""

X_CELL = """
schema_version = 1
name = "X-Cell .60"
environment = { gravity_m_s2 = 9.80665, air_density_kg_m3 = 1.225 }
body = { mass_kg = 8.2, inertia_xx_kg_m2 = 0.18, inertia_yy_kg_m2 = 0.34, inertia_zz_kg_m2 = 0.28 }
fuselage = { area_x_m2 = 0.10, area_y_m2 = 0.22, area_z_m2 = 0.15 }
vertical_fin = { area_m2 = 0.012, lift_slope_per_rad = 2.0, tail_inflow_fraction = 0.2 }
horizontal_fin = { area_m2 = 0.01, lift_slope_per_rad = 3.0, behind_cg_m = 0.71, main_inflow_fraction = 1.0 }
drive = { shaft_power_limit_w = 2000.0 }

[main_rotor]
radius_m = 0.775
blade_count = 2
chord_m = 0.058
speed_rad_s = 167.0
lift_slope_per_rad = 5.5
profile_drag_coefficient = 0.024
stall_blade_loading = 0.14
wake_efficiency = 1.0
blade_flap_inertia_kg_m2 = 0.038
hub_stiffness_n_m_rad = 54.0
hub_above_cg_m = 0.235
flap_response = 0.2

[tail_rotor]
radius_m = 0.13
blade_count = 2
chord_m = 0.029
gear_ratio = 4.66
lift_slope_per_rad = 5.0
profile_drag_coefficient = 0.024
stall_blade_loading = 0.14
wake_efficiency = 1.0
behind_cg_m = 0.91
above_cg_m = 0.08
fin_blockage = 0.83

[skids]
cg_above_skid_m = 0.25
half_length_m = 0.2
half_track_m = 0.15
stiffness_n_m = 4000.0
damping_n_s_m = 160.0
friction_coefficient = 0.4

[cyclic]
frequency_rad_s = 36.0
damping_ratio = 0.5
rate_limit_deg_s = 70.0
minimum_deg = -8.0
maximum_deg = 8.0

[collective]
frequency_rad_s = 36.0
damping_ratio = 0.5
rate_limit_deg_s = 70.0
minimum_deg = -5.0
maximum_deg = 13.0

[pedal]
frequency_rad_s = 44.0
damping_ratio = 0.6
rate_limit_deg_s = 300.0
minimum_deg = -20.0
maximum_deg = 20.0
"""
