// A stand-in for rclcpp where there is no ROS 2: messages come as lines of standard input, and go as lines out. A line is
// a topic and then every field of the message in order. It has what examples/ros2 uses and no more.
#pragma once

#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>
#include <string>

namespace rclcpp {

struct QoS {
  explicit QoS(int) {}
};
struct SensorDataQoS : QoS {
  SensorDataQoS() : QoS(10) {}
};

template <typename Message>
struct Publisher {
  std::string topic;
  void publish(const Message &message) {
    std::cout << topic;
    stand_in::write(std::cout, message);
    std::cout << '\n';
  }
};

template <typename Message>
struct Subscription {
  std::function<void(std::shared_ptr<const Message>)> heard;
};

class Node {
 public:
  explicit Node(const std::string &) {}

  template <typename Value>
  Value declare_parameter(const std::string &, const Value &usual) {
    return usual;
  }

  template <typename Message>
  std::shared_ptr<Publisher<Message>> create_publisher(const std::string &topic, const QoS &) {
    return std::make_shared<Publisher<Message>>(Publisher<Message>{topic});
  }

  template <typename Message, typename Heard>
  std::shared_ptr<Subscription<Message>> create_subscription(const std::string &topic, const QoS &, Heard heard) {
    topics[topic] = [heard](std::istream &in) {
      auto message = std::make_shared<Message>();
      stand_in::read(in, *message);
      if (!in) throw std::runtime_error("a message that is not whole");
      heard(message);
    };
    return std::make_shared<Subscription<Message>>(Subscription<Message>{heard});
  }

  std::map<std::string, std::function<void(std::istream &)>> topics;
};

inline void init(int, char **) { std::cout.precision(17); }
inline void shutdown() {}
inline void spin(const std::shared_ptr<Node> &node) {
  for (std::string line, topic; std::getline(std::cin, line);) {
    std::istringstream in(line);
    in >> topic;
    node->topics.at(topic)(in);
  }
}

}  // namespace rclcpp
