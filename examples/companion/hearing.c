/* MAVLink messages to readings: units and frames of the header, times of the vehicle's own clock. */
#include <math.h>
#include <string.h>

#include "companion.h"

#define RADIANS (3.14159265358979323846 / 180.0)
#define DOWNWARD 25 /* MAV_SENSOR_ROTATION_PITCH_270 */
#define LONGEST_EXPOSURE_S 1.0
#define SAME_CLOCK_S 10.0

/* A message's time on the clock that all readings share: some receivers stamp with the time of day. */
static double stamped(struct companion *c, double said_s) {
  if (c->newest_s > 0.0 && fabs(said_s - c->newest_s) > SAME_CLOCK_S && said_s > 1e8) return c->newest_s;
  if (said_s > c->newest_s) c->newest_s = said_s;
  return said_s;
}

static void give(struct companion *c, double t_s, int sensor, const flownav_reading *reading) {
  unsigned i;
  const int said = flownav_take(&c->nav, &c->settings, t_s, sensor, reading, &c->outcome);
  c->readings += 1;
  if (said == FLOWNAV_BEGUN_ANEW) c->resets += 1;
  else if (said != FLOWNAV_TAKEN) c->dropped += 1;
  for (i = 0; i < (unsigned)c->outcome.events; ++i) {
    const int kind = (int)c->outcome.event[i].kind;
    if (kind == FLOWNAV_EVENT_GPS_RESET || kind == FLOWNAV_EVENT_HEADING_FOUND || kind == FLOWNAV_EVENT_HEADING_REFUTED)
      c->resets += 1;
  }
}

static flownav_reading of(double a, double b, double c) {
  flownav_reading reading = flownav_blank();
  reading.value[0] = a;
  reading.value[1] = b;
  reading.value[2] = c;
  return reading;
}

static int hear_imu(struct companion *c, const mavlink_message_t *message) {
  mavlink_highres_imu_t m;
  flownav_reading reading;
  double t_s;
  mavlink_msg_highres_imu_decode(message, &m);
  t_s = stamped(c, (double)m.time_usec * 1e-6);
  if ((m.fields_updated & 0x1C0) == 0x1C0) {
    reading = of(m.xmag, m.ymag, m.zmag);
    give(c, t_s, FLOWNAV_MAG, &reading);
  }
  if ((m.fields_updated & 0x200) != 0 && m.abs_pressure > 0.0f) { /* ISO 2533, to 11 km */
    reading = of(44330.77 * (1.0 - pow((double)m.abs_pressure / 1013.25, 0.1902632)), NAN, NAN);
    give(c, t_s, FLOWNAV_BARO, &reading);
  }
  if ((m.fields_updated & 0x3F) != 0x3F) return 0;
  reading = of(m.xgyro, m.ygyro, m.zgyro);
  reading.value[3] = m.xacc;
  reading.value[4] = m.yacc;
  reading.value[5] = m.zacc;
  give(c, t_s, FLOWNAV_IMU, &reading);
  return 1;
}

static void hear_flow(struct companion *c, const mavlink_message_t *message) {
  mavlink_optical_flow_rad_t m;
  flownav_reading reading;
  double t_s, lasts_s;
  mavlink_msg_optical_flow_rad_decode(message, &m);
  t_s = stamped(c, (double)m.time_usec * 1e-6);
  lasts_s = m.integration_time_us * 1e-6;
  if (lasts_s > 0.0 && lasts_s <= LONGEST_EXPOSURE_S) {
    reading = of(m.integrated_x / lasts_s, m.integrated_y / lasts_s, m.integrated_xgyro / lasts_s);
    reading.value[3] = m.integrated_ygyro / lasts_s;
    reading.quality = m.quality;
    reading.delay_s = 0.5 * lasts_s;
    reading.exposure_s = lasts_s;
    give(c, t_s, FLOWNAV_FLOW_RATE, &reading);
  }
  if (m.distance > 0.0f) {
    reading = of(m.distance, NAN, NAN);
    reading.delay_s = m.time_delta_distance_us * 1e-6;
    give(c, t_s, FLOWNAV_RANGE, &reading);
  }
}

static void hear_range(struct companion *c, const mavlink_message_t *message) {
  mavlink_distance_sensor_t m;
  flownav_reading reading;
  mavlink_msg_distance_sensor_decode(message, &m);
  if (m.orientation != DOWNWARD || m.signal_quality == 1 || m.current_distance == 0) return;
  if (m.max_distance > m.min_distance && (m.current_distance < m.min_distance || m.current_distance > m.max_distance)) return;
  reading = of(m.current_distance * 1e-2, NAN, NAN);
  if (m.covariance > 0 && m.covariance < 255) reading.variance[0] = m.covariance * 1e-4;
  if (m.signal_quality > 0) reading.quality = m.signal_quality * 2.55;
  give(c, stamped(c, m.time_boot_ms * 1e-3), FLOWNAV_RANGE, &reading);
}

/* Earth-centred coordinates [m] of latitude, longitude [deg] and altitude [m]: WGS 84. */
static void earth_centred(const double place[3], double found[3]) {
  const double a = 6378137.0, e2 = 6.69437999014132e-3, latitude = place[0] * RADIANS, longitude = place[1] * RADIANS;
  const double sine = sin(latitude), normal = a / sqrt(1.0 - e2 * sine * sine);
  found[0] = (normal + place[2]) * cos(latitude) * cos(longitude);
  found[1] = (normal + place[2]) * cos(latitude) * sin(longitude);
  found[2] = (normal * (1.0 - e2) + place[2]) * sine;
}

static void local(const double origin[3], const double place[3], double ned[3]) {
  double from[3], to[3], d[3];
  const double sa = sin(origin[0] * RADIANS), ca = cos(origin[0] * RADIANS);
  const double so = sin(origin[1] * RADIANS), co = cos(origin[1] * RADIANS);
  int i;
  earth_centred(origin, from);
  earth_centred(place, to);
  for (i = 0; i < 3; ++i) d[i] = to[i] - from[i];
  ned[0] = -sa * co * d[0] - sa * so * d[1] + ca * d[2];
  ned[1] = -so * d[0] + co * d[1];
  ned[2] = -ca * co * d[0] - ca * so * d[1] - sa * d[2];
}

static double square(double value) { return value > 0.0 ? value * value : NAN; }

static void hear_gps(struct companion *c, const mavlink_message_t *message) {
  mavlink_gps_raw_int_t m;
  flownav_reading reading;
  double place[3], ned[3], t_s;
  mavlink_msg_gps_raw_int_decode(message, &m);
  if (m.fix_type < 3 || m.time_usec == c->fix_us) return; /* one that comes twice is no second witness */
  c->fix_us = m.time_usec;
  t_s = stamped(c, (double)m.time_usec * 1e-6);
  place[0] = m.lat * 1e-7;
  place[1] = m.lon * 1e-7;
  place[2] = m.alt * 1e-3;
  if (!c->has_origin) memcpy(c->origin_deg_m, place, sizeof place);
  c->has_origin = 1;
  if (m.vel != 65535 && m.cog != 65535) {
    const double speed = m.vel * 1e-2, course = m.cog * 1e-2 * RADIANS;
    reading = of(speed * cos(course), speed * sin(course), NAN);
    reading.variance[0] = reading.variance[1] = square(m.vel_acc * 1e-3);
    reading.delay_s = c->gps_delay_s;
    give(c, t_s, FLOWNAV_GPS_VELOCITY, &reading);
  }
  local(c->origin_deg_m, place, ned);
  reading = of(ned[0], ned[1], ned[2]);
  reading.variance[0] = reading.variance[1] = square(m.h_acc * 1e-3);
  reading.variance[2] = square(m.v_acc * 1e-3);
  reading.delay_s = c->gps_delay_s;
  give(c, t_s, FLOWNAV_GPS_POSITION, &reading);
}

static void hear_attitude(struct companion *c, const mavlink_message_t *message) {
  mavlink_attitude_quaternion_t m;
  flownav_reading reading;
  mavlink_msg_attitude_quaternion_decode(message, &m);
  reading = of(m.q1, m.q2, m.q3);
  reading.value[3] = m.q4;
  give(c, stamped(c, m.time_boot_ms * 1e-3), FLOWNAV_ATTITUDE, &reading);
}

int hear(struct companion *c, const mavlink_message_t *message) {
  mavlink_extended_sys_state_t state;
  flownav_reading reading;
  if (message->compid != MAV_COMP_ID_AUTOPILOT1) return 0;
  switch (message->msgid) {
    case MAVLINK_MSG_ID_HEARTBEAT:
      c->autopilot = mavlink_msg_heartbeat_get_autopilot(message);
      return 0;
    case MAVLINK_MSG_ID_HIGHRES_IMU: return hear_imu(c, message);
    case MAVLINK_MSG_ID_OPTICAL_FLOW_RAD: hear_flow(c, message); return 0;
    case MAVLINK_MSG_ID_DISTANCE_SENSOR: hear_range(c, message); return 0;
    case MAVLINK_MSG_ID_GPS_RAW_INT: hear_gps(c, message); return 0;
    case MAVLINK_MSG_ID_ATTITUDE_QUATERNION: hear_attitude(c, message); return 0;
    case MAVLINK_MSG_ID_EXTENDED_SYS_STATE:
      mavlink_msg_extended_sys_state_decode(message, &state);
      if (state.landed_state == MAV_LANDED_STATE_UNDEFINED || c->newest_s == 0.0) return 0;
      reading = of(state.landed_state == MAV_LANDED_STATE_ON_GROUND ? 1.0 : 0.0, NAN, NAN);
      give(c, c->newest_s, FLOWNAV_LANDED, &reading);
      return 0;
    default: return 0;
  }
}
