// ROS's messages as readings of the flownav library, and its state as Odometry. ROS has ENU and FLU (REP 103), flownav
// NED and FRD. mavros tells flow in base_link.
#pragma once

#include <array>
#include <cmath>
#include <string>

#include "flownav.h"

#include <diagnostic_msgs/msg/diagnostic_status.hpp>
#include <mavros_msgs/msg/optical_flow_rad.hpp>
#include <nav_msgs/msg/odometry.hpp>
#include <sensor_msgs/msg/imu.hpp>
#include <sensor_msgs/msg/nav_sat_fix.hpp>
#include <sensor_msgs/msg/range.hpp>

namespace flownav_ros {

constexpr double RADIANS = 3.14159265358979323846 / 180.0;

inline flownav_reading reading_of(const sensor_msgs::msg::Imu &m) {
  flownav_reading r = flownav_blank();
  r.value[0] = m.angular_velocity.x;
  r.value[1] = -m.angular_velocity.y;
  r.value[2] = -m.angular_velocity.z;
  r.value[3] = m.linear_acceleration.x;
  r.value[4] = -m.linear_acceleration.y;
  r.value[5] = -m.linear_acceleration.z;
  return r;
}

inline flownav_reading reading_of(const sensor_msgs::msg::Range &m) {
  flownav_reading r = flownav_blank();
  const bool within = m.range >= m.min_range && (m.range <= m.max_range || m.max_range <= m.min_range);
  if (within) r.value[0] = m.range;  // else it is said to have seen nothing
  return r;
}

inline flownav_reading reading_of(const mavros_msgs::msg::OpticalFlowRad &m) {
  flownav_reading r = flownav_blank();
  const double lasts_s = 1e-6 * m.integration_time_us;
  r.value[0] = m.integrated_x / lasts_s;
  r.value[1] = -m.integrated_y / lasts_s;
  r.value[2] = m.integrated_xgyro / lasts_s;
  r.value[3] = -m.integrated_ygyro / lasts_s;
  r.quality = m.quality;
  r.delay_s = 0.5 * lasts_s;
  r.exposure_s = lasts_s;
  return r;
}

// Where fixes are told from: the first of them.
class Origin {
 public:
  // North, east, down [m] of the origin (WGS 84).
  flownav_reading reading_of(const sensor_msgs::msg::NavSatFix &m, double delay_s) {
    const Vector place{m.latitude, m.longitude, m.altitude};
    if (!set_) place_ = place;
    set_ = true;
    const Vector from = earth_centred(place_), to = earth_centred(place);
    const double x = to[0] - from[0], y = to[1] - from[1], z = to[2] - from[2];
    const double sa = std::sin(place_[0] * RADIANS), ca = std::cos(place_[0] * RADIANS);
    const double so = std::sin(place_[1] * RADIANS), co = std::cos(place_[1] * RADIANS);
    flownav_reading r = flownav_blank();
    r.value[0] = -sa * co * x - sa * so * y + ca * z;
    r.value[1] = -so * x + co * y;
    r.value[2] = -ca * co * x - ca * so * y - sa * z;
    if (m.position_covariance_type > 0) {  // of east, north, up
      r.variance[0] = m.position_covariance[4];
      r.variance[1] = m.position_covariance[0];
      r.variance[2] = m.position_covariance[8];
    }
    r.delay_s = delay_s;
    return r;
  }

 private:
  using Vector = std::array<double, 3>;

  static Vector earth_centred(const Vector &place) {
    const double a = 6378137.0, e2 = 6.69437999014132e-3;
    const double latitude = place[0] * RADIANS, longitude = place[1] * RADIANS, sine = std::sin(latitude);
    const double normal = a / std::sqrt(1.0 - e2 * sine * sine);
    return {(normal + place[2]) * std::cos(latitude) * std::cos(longitude),
            (normal + place[2]) * std::cos(latitude) * std::sin(longitude),
            (normal * (1.0 - e2) + place[2]) * sine};
  }

  Vector place_{};
  bool set_ = false;
};

// Where the upper triangle of a symmetric matrix has row i, column j.
inline int upper(int size, int i, int j) {
  if (i > j) std::swap(i, j);
  return i * size - i * (i - 1) / 2 + j - i;
}

inline nav_msgs::msg::Odometry odometry_of(const flownav_state &s) {
  nav_msgs::msg::Odometry m;
  m.pose.pose.position.x = s.pos_ned_m[1];
  m.pose.pose.position.y = s.pos_ned_m[0];
  m.pose.pose.position.z = -s.pos_ned_m[2];
  const double half = std::sqrt(0.5), w = s.quaternion[0], x = s.quaternion[1], y = s.quaternion[2], z = s.quaternion[3];
  m.pose.pose.orientation.w = half * (w + z);
  m.pose.pose.orientation.x = half * (x + y);
  m.pose.pose.orientation.y = half * (x - y);
  m.pose.pose.orientation.z = half * (w - z);
  m.twist.twist.linear.x = s.vel_frd_m_s[0];
  m.twist.twist.linear.y = -s.vel_frd_m_s[1];
  m.twist.twist.linear.z = -s.vel_frd_m_s[2];
  m.twist.twist.angular.x = s.rate_frd_rad_s[0];
  m.twist.twist.angular.y = -s.rate_frd_rad_s[1];
  m.twist.twist.angular.z = -s.rate_frd_rad_s[2];
  // east, north, up and roll, pitch, yaw of FLU, of what is north, east, down and roll, pitch, yaw of FRD
  static const int place[6] = {1, 0, 2, 3, 4, 5};
  static const double sign[6] = {1.0, 1.0, -1.0, 1.0, -1.0, -1.0};
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j)
      m.pose.covariance[6 * i + j] = sign[i] * sign[j] * s.pose_covariance[upper(6, place[i], place[j])];
  static const double body[3] = {1.0, -1.0, -1.0};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      m.twist.covariance[6 * i + j] = body[i] * body[j] * s.vel_frd_covariance[upper(3, i, j)];
      m.twist.covariance[6 * (i + 3) + j + 3] = body[i] * body[j] * s.rate_covariance[upper(3, i, j)];
    }
  return m;
}

// What is to be said of a state: ERROR means that it must not be flown on.
inline diagnostic_msgs::msg::DiagnosticStatus status_of(int said, const flownav_state &s, double most_protection_m) {
  using Status = diagnostic_msgs::msg::DiagnosticStatus;
  Status m;
  m.name = "flownav";
  m.level = Status::OK;
  m.message = "navigating";
  const auto is = [&m](decltype(m.level) level, const std::string &why) {
    m.level = level;
    m.message = why;
  };
  if (said != FLOWNAV_TOLD) is(Status::ERROR, "no state: it has not started, or readings stay away");
  else if (s.aid == 2.0) is(Status::ERROR, "the position is invalid");
  else if (s.suspected > 0.0) is(Status::ERROR, "a fault is suspected: " + std::to_string(static_cast<int>(s.suspected) - 1));
  else if (s.protection_m[0] > most_protection_m) is(Status::ERROR, "the protection level is beyond what is asked for");
  else if (s.aid == 1.0) is(Status::WARN, "dead reckoning");
  return m;
}

}  // namespace flownav_ros
