/* The state of now as ODOMETRY, where it may be flown on. */
#include <math.h>
#include <string.h>

#include "companion.h"

#define SYSTEM 1
#define COMPONENT MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
#define MOST_PROTECTION_M 10.0

/* The upper triangle of 6 by 6 with two upper triangles of 3 by 3 on its diagonal. */
static void velocity_covariance(const flownav_state *state, float found[21]) {
  static const int first[3] = {0, 6, 11}, second[3] = {15, 18, 20};
  int i, j, k = 0;
  memset(found, 0, 21 * sizeof found[0]);
  for (i = 0; i < 3; ++i)
    for (j = i; j < 3; ++j, ++k) {
      found[first[i] + j - i] = (float)state->vel_frd_covariance[k];
      found[second[i] + j - i] = (float)state->rate_covariance[k];
    }
}

/* No state to fly on: none, an invalid position, a sensor that fails, or one that may have failed unseen. */
static int must_not_be_flown_on(const flownav_state *state) {
  return state->aid == 2.0 || state->suspected > 0.0 || state->protection_m[0] > MOST_PROTECTION_M;
}

unsigned tell(struct companion *c, double t_s, uint8_t frame[MAVLINK_MAX_PACKET_LEN]) {
  flownav_state state;
  mavlink_odometry_t said;
  mavlink_message_t message;
  int i;
  if (flownav_now(&c->nav, &c->settings, t_s, &state) != FLOWNAV_TOLD || must_not_be_flown_on(&state)) {
    c->withheld += 1;
    return 0;
  }
  memset(&said, 0, sizeof said);
  said.time_usec = (uint64_t)llround(t_s * 1e6);
  said.frame_id = c->autopilot == MAV_AUTOPILOT_PX4 ? MAV_FRAME_LOCAL_NED : MAV_FRAME_LOCAL_FRD;
  said.child_frame_id = MAV_FRAME_BODY_FRD;
  said.x = (float)state.pos_ned_m[0];
  said.y = (float)state.pos_ned_m[1];
  said.z = (float)state.pos_ned_m[2];
  said.vx = (float)state.vel_frd_m_s[0];
  said.vy = (float)state.vel_frd_m_s[1];
  said.vz = (float)state.vel_frd_m_s[2];
  said.rollspeed = (float)state.rate_frd_rad_s[0];
  said.pitchspeed = (float)state.rate_frd_rad_s[1];
  said.yawspeed = (float)state.rate_frd_rad_s[2];
  for (i = 0; i < 4; ++i) said.q[i] = (float)state.quaternion[i];
  for (i = 0; i < 21; ++i) said.pose_covariance[i] = (float)state.pose_covariance[i];
  velocity_covariance(&state, said.velocity_covariance);
  said.reset_counter = (uint8_t)(c->resets & 255u);
  said.estimator_type = MAV_ESTIMATOR_TYPE_VIO;
  c->told += 1;
  mavlink_msg_odometry_encode(SYSTEM, COMPONENT, &message, &said);
  return mavlink_msg_to_send_buffer(frame, &message);
}

unsigned heartbeat(uint8_t frame[MAVLINK_MAX_PACKET_LEN]) {
  mavlink_message_t message;
  mavlink_msg_heartbeat_pack(SYSTEM, COMPONENT, &message, MAV_TYPE_ONBOARD_CONTROLLER, MAV_AUTOPILOT_INVALID, 0, 0,
                             MAV_STATE_ACTIVE);
  return mavlink_msg_to_send_buffer(frame, &message);
}
