// What the Python package asks of the core, without Python: runs with hooks, recorded runs, episodes that are
// stepped from outside, calibrated sensors. In: request, functions -> out: figures as JSON, columns, numbers.
// Each robot is compiled once (robot_*.cpp). Simulation only.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "app/sim/sim_job.hpp"
#include "equipoise/no_copy.hpp"
#include "equipoise/plant/engine.hpp"
#include "equipoise/runtime/fields.hpp"
#include "robots/robot_list.hpp"

namespace equipoise::python {

struct Column {
  std::string name;
  char type;  // of Python's struct module
  int count;  // 0: a scalar
};

struct Channel {
  std::vector<Column> columns;
  std::string packed;
};

class Recorder {
 public:
  explicit Recorder(const std::vector<std::string>& estimators) {
    for (const std::string& name : estimators) {
      std::string channel(runtime::fields::kComparedChannel);
      for (const char c : name) channel += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
      compared_.push_back(channel);
    }
  }

  void add(const runtime::TickRecord& r) {
    namespace fields = runtime::fields;
    fields::each_message(
        r, [&](auto message, const char* channel, const auto& record) { put(message, channel, record, r); });
    if (r.has_truth) put(fields::State{}, fields::kTruthChannel, r.truth, r);
    if (r.faults.bound > 0.0) put(fields::Faults{}, fields::kFaultsChannel, r.faults, r);
    for (std::size_t i = 0; i < compared_.size() && i < r.others.size(); ++i) {
      if ((r.compared >> i & 1U) != 0) put(fields::State{}, compared_[i].c_str(), r.others[i], r);
    }
  }

  const std::map<std::string, Channel>& channels() const { return channels_; }

 private:
  template <class Message, class Record>
  void put(Message, const char* name, const Record& record, const runtime::TickRecord& tick) {
    Channel& channel = channels_[name];
    const bool first = channel.columns.empty();
    const auto field = [&](const char* column, const auto& value) {
      if (first) channel.columns.push_back(described(column, value));
      channel.packed.append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    field("utime", tick.now_ns / 1000);
    field("tick", tick.tick);
    Message::visit(record, field);
  }

  template <class T>
  static Column described(const char* name, const T& value) {
    if constexpr (std::is_arithmetic_v<T>) {
      return {name, code<T>(), 0};
    } else {
      return {name, code<std::decay_t<decltype(value[0])>>(), static_cast<int>(std::size(value))};
    }
  }

  template <class T>
  static constexpr char code() {
    if (std::is_same_v<T, bool>) return '?';
    if (std::is_floating_point_v<T>) return sizeof(T) == 8 ? 'd' : 'f';
    constexpr const char* kSigned = "bhiq";
    constexpr std::size_t kPower = sizeof(T) == 1 ? 0 : sizeof(T) == 2 ? 1 : sizeof(T) == 4 ? 2 : 3;
    return kSigned[kPower];  // LCM has signed numbers only
  }

  std::vector<std::string> compared_;
  std::map<std::string, Channel> channels_;
};

/// What a controller is told, before it says u about the input axes.
struct ControllerTick {
  double t_s = 0.0;
  StateView estimate;
  StateView reference;
  Eigen::VectorXd error;  // reference minus estimate, in the order of Simulated::kErrorNames
  Eigen::VectorXd u_own;  // of the robot's feedback
};

/// What an estimator is told, before it says where the robot is.
struct EstimatorTick {
  double t_s = 0.0;
  bool held = false;  // motors off: the robot is not balancing
  Vec3 gyro_B_rad_s, accel_B_m_s2, attitude_rad;
  bool imu_ok = false, encoders_ok = false, attitude_ok = false;
  Eigen::VectorXd wheel_angle_rad, wheel_rate_rad_s;
  Eigen::VectorXd u;  // as applied since the last tick, about the input axes
  StateView own;      // what the robot's estimator says
};

struct Hooks {
  std::function<Eigen::VectorXd(const ControllerTick&)> controller;
  std::function<StateView(const EstimatorTick&)> estimator;
  bool any() const { return controller || estimator; }
};

/// A robot that stands and waits for the next action.
class Episode : NoCopy {
 public:
  virtual ~Episode() = default;
  /// One tick with the motors driven by `wheels`, -1 to 1 each; false when the robot is lost.
  virtual bool step(const double* wheels) = 0;
  virtual void observation(double* out) const = 0;
  virtual StateView truth() const = 0;
};

/// One robot for all configurations of it.
class Simulated : NoCopy {
 public:
  virtual ~Simulated() = default;

  virtual int wheels() const = 0;
  virtual int inputs() const = 0;
  virtual std::vector<std::string> error_names() const = 0;
  virtual std::vector<std::string> observation_names() const = 0;
  virtual std::vector<std::string> estimators() const = 0;
  virtual std::vector<std::string> controllers() const = 0;
  /// `recorder` may be nullptr.
  virtual nlohmann::json run(app::SimRequest request, const Hooks& hooks, Recorder* recorder,
                             const app::TickObserver& observe, const std::atomic<bool>& stop) const = 0;
  /// Of the robot as drawn, SI by name: what an engine builds it from.
  virtual nlohmann::json dimensions(app::SimRequest request) const = 0;
  /// The same run in an engine that `make` builds from those.
  using MakeEngine = std::function<std::unique_ptr<Engine>(const nlohmann::json& dimensions)>;
  virtual nlohmann::json run_in_engine(app::SimRequest request, const MakeEngine& make, const Hooks& hooks,
                                       const std::atomic<bool>& stop) const = 0;
  /// f(seed): configured once, as many episodes as are wanted; in our world, or in the engine that `make`
  /// builds.
  virtual std::function<std::unique_ptr<Episode>(std::uint64_t)> episodes(app::SimRequest request,
                                                                          const MakeEngine& make) const = 0;
  /// Row by row: gyro, accelerometer, attitude (3 each), battery, wheel angles. `toml`: of the run's log.
  virtual void calibrate(const std::string& toml, const std::vector<RawSample>& raw, double* out) const = 0;
};

const Simulated& simulated_as(MbbrFirmware robot);
const Simulated& simulated_as(MipFirmware robot);
/// By robot.type of a configuration.
const Simulated& simulated(const std::string& type);

}  // namespace equipoise::python
