// equipoise_robot._core: the simulation, in process. Arguments are checked by equipoise_robot's Python side
// where they have names there; configurations and choices are checked here, and complaints become UserError.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <chrono>
#include <exception>

#include "app/design/analysis.hpp"
#include "app/text/errors.hpp"
#include "app/text/reasons.hpp"
#include "app/text/version.hpp"
#include "equipoise/config.hpp"
#include "python/episodes.hpp"
#include "python/python_engine.hpp"

namespace equipoise::python {

namespace {

/// Ctrl-C, and who wants to know how far a run is: now and then, by the wall clock.
class Attention : public Guarded {
 public:
  Attention(nb::object progress, std::atomic<bool>* stop) : Guarded(stop), progress_(std::move(progress)) {}

  void at(double t_s) {
    if (++ticks_ % kTicksBetween != 0 || Clock::now() < next_) return;
    next_ = Clock::now() + std::chrono::milliseconds(50);
    const nb::gil_scoped_acquire python;
    if (PyErr_CheckSignals() != 0) {
      keep([] { throw nb::python_error(); });
    } else if (!progress_.is_none()) {
      keep([&] { progress_(t_s); });
    }
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr int kTicksBetween = 64;
  nb::object progress_;
  int ticks_ = 0;
  Clock::time_point next_ = Clock::now();
};

Hooks hooks_of(const nb::object& controller, const nb::object& estimator, int inputs, Attention* attention) {
  Hooks hooks;
  if (!controller.is_none()) {
    hooks.controller = [=](const ControllerTick& tick) {
      Eigen::VectorXd u = Eigen::VectorXd::Constant(inputs, std::numeric_limits<double>::quiet_NaN());
      attention->keep([&] {
        const auto values = nb::cast<std::vector<double>>(controller(tick));
        if (values.size() != static_cast<std::size_t>(inputs))
          throw app::InputError("the controller returned " + std::to_string(values.size()) +
                                " numbers; this robot has " + std::to_string(inputs) + " inputs");
        u = Eigen::Map<const Eigen::VectorXd>(values.data(), inputs);
      });
      return u;
    };
  }
  if (!estimator.is_none()) {
    hooks.estimator = [=](const EstimatorTick& tick) {
      StateView x = tick.own;
      attention->keep([&] {
        const nb::object answer = estimator(tick);
        if (!nb::isinstance<StateView>(answer))
          throw app::InputError("the estimator returned no State; start from tick.own or State()");
        x = nb::cast<StateView>(answer);
      });
      return x;
    };
  }
  return hooks;
}

nb::dict columns_of(const Recorder& recorder) {
  nb::dict out;
  for (const auto& [name, channel] : recorder.channels()) {
    nb::list columns;
    for (const Column& c : channel.columns)
      columns.append(nb::make_tuple(c.name, std::string(1, c.type), c.count));
    out[name.c_str()] = nb::make_tuple(columns, nb::bytes(channel.packed.data(), channel.packed.size()));
  }
  return out;
}

nb::tuple run(app::SimRequest request, const nb::object& controller, const nb::object& estimator, bool record,
              const nb::object& progress) {
  app::check(request);
  const Simulated& robot = simulated(robot_type(request.config));
  std::atomic<bool> stop{false};
  Attention attention(progress, &stop);
  const Hooks hooks = hooks_of(controller, estimator, robot.inputs(), &attention);
  std::optional<Recorder> recorder;
  if (record) recorder.emplace(robot.estimators());
  const app::TickObserver observe = [&](const runtime::TickRecord& r) {
    attention.at(static_cast<double>(r.now_ns) * 1e-9);
  };
  std::string json;
  const auto simulate = [&] {
    json = robot.run(request, hooks, recorder ? &*recorder : nullptr, observe, stop).dump();
  };
  if (hooks.any()) {
    simulate();
  } else {
    const nb::gil_scoped_release others;
    simulate();
  }
  attention.rethrow();
  return nb::make_tuple(json, recorder ? nb::object(columns_of(*recorder)) : nb::none());
}

std::string run_in_engine(app::SimRequest request, const nb::object& make, const nb::object& controller,
                          const nb::object& estimator) {
  app::check(request);
  std::atomic<bool> stop{false};
  Attention attention(nb::none(), &stop);
  const auto engine = [&](const nlohmann::json& dimensions) {
    return std::make_unique<PythonEngine>(make, dimensions, &attention);
  };
  const Simulated& robot = simulated(robot_type(request.config));
  const Hooks hooks = hooks_of(controller, estimator, robot.inputs(), &attention);
  const nlohmann::json out = robot.run_in_engine(std::move(request), engine, hooks, stop);
  attention.rethrow();
  return out.dump();
}

/// Raw samples of a log, field by field, as SI.
nb::ndarray<nb::numpy, double, nb::ndim<2>> calibrated(const std::string& type, const std::string& toml,
                                                       const Array& gyro, const Array& accel,
                                                       const Array& encoders, const Array& battery,
                                                       const Array& attitude) {
  const Simulated& robot = simulated(type);
  const std::size_t n = battery.size();
  if (gyro.size() != 3 * n || accel.size() != 3 * n || encoders.size() != kMaxMotors * n ||
      attitude.size() != 4 * n)
    throw nb::value_error("the sensors' fields differ in length");
  std::vector<RawSample> raw(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto fill = [i](auto& field, const double* from) {
      const std::size_t count = std::size(field);
      for (std::size_t k = 0; k < count; ++k)
        field[k] = static_cast<std::decay_t<decltype(field[0])>>(from[i * count + k]);
    };
    fill(raw[i].gyro_counts, gyro.data());
    fill(raw[i].accel_counts, accel.data());
    fill(raw[i].encoder_counts, encoders.data());
    fill(raw[i].attitude_wxyz, attitude.data());
    raw[i].battery_counts = static_cast<decltype(raw[i].battery_counts)>(battery.data()[i]);
  }
  const auto width = 10 + static_cast<std::size_t>(robot.wheels());
  auto* out = new double[n * width];
  const nb::capsule owner(out, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  robot.calibrate(toml, raw, out);
  return nb::ndarray<nb::numpy, double, nb::ndim<2>>(out, {n, width}, owner);
}

/// Read as a view, so that an element can be set; set from any sequence.
template <auto Member, std::size_t N>
void def_vector(nb::class_<StateView>& state, const char* name, const char* doc) {
  state.def_prop_rw(
      name, [](StateView & v) -> Vec<static_cast<int>(N)>& { return v.*Member; },
      [](StateView& v, const std::array<double, N>& values) {
        for (std::size_t i = 0; i < N; ++i) (v.*Member)(static_cast<Eigen::Index>(i)) = values[i];
      },
      nb::rv_policy::reference_internal, doc);
}

void bind_values(nb::module_& m) {
  nb::class_<StateView> state(m, "State", "Where the robot is: an estimate, a reference or the truth.");
  state.def(nb::init<>());
  def_vector<&StateView::theta_rad, 3>(state, "theta_rad", "roll, pitch, yaw (eduMIP: tilt, 0, yaw)");
  def_vector<&StateView::omega_B_rad_s, 3>(state, "omega_B_rad_s", "body rates");
  def_vector<&StateView::phi_rad, 2>(state, "phi_rad",
                                     "ball angles, inertial (eduMIP: mean encoder angle, 0)");
  def_vector<&StateView::phi_dot_rad_s, 2>(state, "phi_dot_rad_s", "their rates, yaw frame");
  def_vector<&StateView::position_W_m, 2>(state, "position_W_m", "where it stands");
  state.def_rw("normalized_innovation", &StateView::normalized_innovation);
  nb::class_<ControllerTick>(m, "ControllerTick", "What a controller is told before it says u.")
      .def_ro("t_s", &ControllerTick::t_s)
      .def_ro("estimate", &ControllerTick::estimate)
      .def_ro("reference", &ControllerTick::reference)
      .def_ro("error", &ControllerTick::error, "reference minus estimate; see error_names()")
      .def_ro("u_own", &ControllerTick::u_own, "what the robot's own feedback would do");
  nb::class_<EstimatorTick>(m, "EstimatorTick", "What an estimator is told before it returns a State.")
      .def_ro("t_s", &EstimatorTick::t_s)
      .def_ro("held", &EstimatorTick::held, "motors off: the robot is not balancing")
      .def_ro("gyro_B_rad_s", &EstimatorTick::gyro_B_rad_s)
      .def_ro("accel_B_m_s2", &EstimatorTick::accel_B_m_s2, "gravity minus acceleration: at rest z = -9.8")
      .def_ro("attitude_rad", &EstimatorTick::attitude_rad, "of the attitude source")
      .def_ro("imu_ok", &EstimatorTick::imu_ok)
      .def_ro("encoders_ok", &EstimatorTick::encoders_ok)
      .def_ro("attitude_ok", &EstimatorTick::attitude_ok)
      .def_ro("wheel_angle_rad", &EstimatorTick::wheel_angle_rad, "relative to the body")
      .def_ro("wheel_rate_rad_s", &EstimatorTick::wheel_rate_rad_s)
      .def_ro("u", &EstimatorTick::u, "applied since the last tick")
      .def_ro("own", &EstimatorTick::own, "what the robot's own estimator says");
}

void bind_request(nb::module_& m) {
  using app::SimRequest;
  nb::class_<SimRequest> request(m, "Request", "A run as it is asked for.");
  request.def(nb::init<>())
      .def_rw("config", &SimRequest::config)
      .def_rw("set", &SimRequest::set)
      .def_rw("robot_number", &SimRequest::robot)
      .def_rw("yaw_rate_rad_s", &SimRequest::yaw_rate_rad_s)
      .def_rw("drive_mps", &SimRequest::drive_mps)
      .def_rw("path", &SimRequest::path)
      .def_rw("fault", &SimRequest::fault)
      .def_rw("duration_s", &SimRequest::duration_s)
      .def_rw("seed", &SimRequest::seed);
  const auto choice = [&request](const char* name, auto member) {
    request.def_prop_rw(
        name, [member](const SimRequest& r) { return r.choice.*member; },
        [member](SimRequest& r, std::decay_t<decltype(r.choice.*member)> value) {
          r.choice.*member = std::move(value);
        });
  };
  choice("estimator", &Choice::estimator);
  choice("controller", &Choice::controller);
  choice("fidelity", &Choice::fidelity);
  choice("attitude", &Choice::attitude);
  choice("compare", &Choice::compare);
}

}  // namespace

const Simulated& simulated(const std::string& type) {
  return *with_robot(type, "the configuration", [](auto firmware) { return &simulated_as(firmware); });
}

NB_MODULE(_core, m) {
  m.doc() = "Simulation core of equipoise_robot.";
  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const ConfigError& error) {
      PyErr_SetString(nb::module_::import_("equipoise_robot.errors").attr("UserError").ptr(), error.what());
    }
  });
  bind_values(m);
  bind_request(m);
  m.def("version", &app::version);
  m.def("robot_type", &robot_type, nb::arg("config"));
  m.def("run", &run, nb::arg("request"), nb::arg("controller").none(), nb::arg("estimator").none(),
        nb::arg("record"), nb::arg("progress").none(),
        "(figures as JSON, columns by channel where recorded)");
  m.def(
      "dimensions",
      [](const app::SimRequest& request) {
        return simulated(robot_type(request.config)).dimensions(request).dump();
      },
      nb::arg("request"), "of the robot as drawn, SI by name, as JSON");
  m.def("run_in_engine", &run_in_engine, nb::arg("request"), nb::arg("make"),
        nb::arg("controller").none() = nb::none(), nb::arg("estimator").none() = nb::none(),
        "figures as JSON of a run whose rigid bodies are another engine's; "
        "make(dimensions as JSON, in, out) -> (start, step)");
  m.def(
      "design",
      [](const std::string& config, const std::vector<std::string>& set, const std::string& estimator,
         const std::string& controller, double last_hz, double step_hz, bool bode) {
        const nb::gil_scoped_release others;
        return app::design({config, set, estimator, controller, last_hz, step_hz, bode}).dump();
      },
      nb::arg("config"), nb::arg("set"), nb::arg("estimator"), nb::arg("controller"), nb::arg("last_hz"),
      nb::arg("step_hz"), nb::arg("bode"), "the design as JSON");
  m.def("reason_names", &app::reason_names, nb::arg("reasons"), "of the bits of safety's reasons");
  m.def("degraded_names", &app::degraded_names, nb::arg("degraded"));
  const auto names = [&m](const char* name, auto of_robot, const char* doc) {
    m.def(
        name, [of_robot](const std::string& type) { return (simulated(type).*of_robot)(); }, nb::arg("robot"),
        doc);
  };
  names("estimators", &Simulated::estimators, "of the robot");
  names("controllers", &Simulated::controllers, "of the robot");
  names("error_names", &Simulated::error_names, "of ControllerTick.error");
  names("observation_names", &Simulated::observation_names, "of a row of Episodes' observations");
  m.def("calibrated", &calibrated, nb::arg("robot"), nb::arg("config_toml"), nb::arg("gyro"),
        nb::arg("accel"), nb::arg("encoders"), nb::arg("battery"), nb::arg("attitude"),
        "per sample: gyro (3), accelerometer (3), attitude (3), battery, wheel angles");
  nb::class_<Episodes>(m, "Episodes", "Robots that are stepped together.")
      .def(nb::init<const app::SimRequest&, int, int, std::vector<double>, double, nb::object>(),
           nb::arg("request"), nb::arg("count"), nb::arg("jobs"), nb::arg("weights"), nb::arg("action_cost"),
           nb::arg("engine").none(), "engine: as run_in_engine's make, one by one on the caller's thread")
      .def_prop_ro("count", &Episodes::count)
      .def_prop_ro("wheels", &Episodes::wheels)
      .def_prop_ro("observations", &Episodes::observations)
      .def_prop_ro("rewards", &Episodes::rewards)
      .def_prop_ro("lost", &Episodes::lost)
      .def_prop_ro("active", &Episodes::active)
      .def("reset", &Episodes::reset, nb::arg("which"), nb::arg("seeds"), nb::arg("robot_numbers"))
      .def("step", &Episodes::step, nb::arg("actions"), "how many are lost")
      .def("truth", &Episodes::truth, nb::arg("index"));
}

}  // namespace equipoise::python
