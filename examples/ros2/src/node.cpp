// flownav_node: sensor_msgs/Imu, Range, NavSatFix and mavros_msgs/OpticalFlowRad in; nav_msgs/Odometry and diagnostics out.
//
// Parameters: gps_delay_s (how old a fix is when it is stamped), every_s (between two odometries), most_protection_m
// (an estimate that is protected no better is not published), frame_id, child_frame_id.
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <rclcpp/rclcpp.hpp>

#include "convert.hpp"

namespace flownav_ros {

class Node : public rclcpp::Node {
 public:
  Node() : rclcpp::Node("flownav") {
    gps_delay_s_ = declare_parameter("gps_delay_s", 0.22);
    every_s_ = declare_parameter("every_s", 0.02);
    most_protection_m_ = declare_parameter("most_protection_m", 20.0);
    frame_id_ = declare_parameter("frame_id", std::string("odom"));
    child_frame_id_ = declare_parameter("child_frame_id", std::string("base_link"));
    flownav_begin(&nav_, &flownav_default_settings);
    odometry_ = create_publisher<nav_msgs::msg::Odometry>("~/odometry", rclcpp::SensorDataQoS());
    diagnostics_ = create_publisher<diagnostic_msgs::msg::DiagnosticArray>("/diagnostics", rclcpp::QoS(10));
    imu_ = listen<sensor_msgs::msg::Imu>("imu", [this](const auto &m) {
      take(m, FLOWNAV_IMU, reading_of(m));
      tell(m.header.stamp);
    });
    range_ = listen<sensor_msgs::msg::Range>("range", [this](const auto &m) { take(m, FLOWNAV_RANGE, reading_of(m)); });
    flow_ = listen<mavros_msgs::msg::OpticalFlowRad>("flow", [this](const auto &m) {
      if (m.integration_time_us > 0 && m.integration_time_us <= 1000000) take(m, FLOWNAV_FLOW_RATE, reading_of(m));
    });
    gps_ = listen<sensor_msgs::msg::NavSatFix>("fix", [this](const auto &m) {
      if (m.status.status >= 0) take(m, FLOWNAV_GPS_POSITION, origin_.reading_of(m, gps_delay_s_));
    });
  }

 private:
  template <typename Message, typename Heard>
  std::shared_ptr<rclcpp::Subscription<Message>> listen(const std::string &topic, Heard heard) {
    return create_subscription<Message>(topic, rclcpp::SensorDataQoS(),
                                        [heard](const std::shared_ptr<const Message> m) { heard(*m); });
  }

  // Seconds since the first stamp: doubles keep microseconds of those, and nanoseconds of none of 1970's.
  template <typename Stamp>
  double seconds(const Stamp &stamp) {
    if (!begun_) begin_s_ = stamp.sec;
    begun_ = true;
    return static_cast<double>(stamp.sec - begin_s_) + 1e-9 * stamp.nanosec;
  }

  template <typename Message>
  void take(const Message &m, int sensor, const flownav_reading &reading) {
    const int said = flownav_take(&nav_, &flownav_default_settings, seconds(m.header.stamp), sensor, &reading, &outcome_);
    if (said == FLOWNAV_FAULT) flownav_begin(&nav_, &flownav_default_settings);
  }

  template <typename Stamp>
  void tell(const Stamp &stamp) {
    const double t_s = seconds(stamp);
    if (t_s - told_s_ < every_s_ - 1e-4 && t_s >= told_s_) return;
    told_s_ = t_s;
    const int said = flownav_now(&nav_, &flownav_default_settings, t_s, &state_);
    diagnostic_msgs::msg::DiagnosticArray array;
    array.header.stamp = stamp;
    array.status.push_back(status_of(said, state_, most_protection_m_));
    diagnostics_->publish(array);
    if (array.status[0].level == diagnostic_msgs::msg::DiagnosticStatus::ERROR) return;
    auto odometry = odometry_of(state_);
    odometry.header.stamp = stamp;
    odometry.header.frame_id = frame_id_;
    odometry.child_frame_id = child_frame_id_;
    odometry_->publish(odometry);
  }

  flownav_nav nav_;
  flownav_outcome outcome_;
  flownav_state state_;
  Origin origin_;
  double gps_delay_s_, every_s_, most_protection_m_, told_s_ = -std::numeric_limits<double>::infinity();
  bool begun_ = false;
  int32_t begin_s_ = 0;
  std::string frame_id_, child_frame_id_;
  std::shared_ptr<rclcpp::Publisher<nav_msgs::msg::Odometry>> odometry_;
  std::shared_ptr<rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>> diagnostics_;
  std::shared_ptr<rclcpp::Subscription<sensor_msgs::msg::Imu>> imu_;
  std::shared_ptr<rclcpp::Subscription<sensor_msgs::msg::Range>> range_;
  std::shared_ptr<rclcpp::Subscription<mavros_msgs::msg::OpticalFlowRad>> flow_;
  std::shared_ptr<rclcpp::Subscription<sensor_msgs::msg::NavSatFix>> gps_;
};

}  // namespace flownav_ros

int main(int argc, char **argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<flownav_ros::Node>());
  rclcpp::shutdown();
  return 0;
}
