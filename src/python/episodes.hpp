// Robots that are reset and stepped together, on several threads: what the Gymnasium environments call. In:
// request, actions -> out: observations, rewards, who is lost, in arrays that stay. Simulation only.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <array>
#include <atomic>

#include "app/sim/workers.hpp"
#include "python/python_engine.hpp"
#include "python/simulation.hpp"

namespace equipoise::python {

using Array = nb::ndarray<double, nb::numpy, nb::c_contig, nb::device::cpu>;

class Episodes : NoCopy {
 public:
  /// A tick upright is worth 1, less the squares of the weighted observation and those of the action times
  /// `action_cost`, down to 0; where the robot is lost it is worth nothing.
  /// `engine`: as PythonEngine has it, for bodies that are not ours; None: our own.
  Episodes(const app::SimRequest& request, int count, int jobs, std::vector<double> weights,
           double action_cost, const nb::object& engine)
      : request_(request),
        engine_(
            engine.is_none()
                ? Simulated::MakeEngine{}
                : [this, engine](
                      const nlohmann::json&
                          dimensions) { return std::make_unique<PythonEngine>(engine, dimensions, &guarded_); }),
        robot_(simulated(robot_type(request.config))),
        make_((app::check(request), robot_.episodes(request, engine_))),
        episodes_(static_cast<std::size_t>(count)),
        weights_(std::move(weights)),
        action_cost_(action_cost),
        observations_(episodes_.size() * static_cast<std::size_t>(width_)),
        rewards_(episodes_.size()),
        lost_(std::make_unique<bool[]>(episodes_.size())),
        active_(std::make_unique<bool[]>(episodes_.size())),
        workers_(std::min(app::threads_for(jobs), static_cast<unsigned>(std::max(count, 1)))) {
    if (static_cast<int>(weights_.size()) != width())
      throw nb::value_error("every number of the observation has a weight");
  }

  int count() const { return static_cast<int>(episodes_.size()); }
  int wheels() const { return wheels_; }

  // Views of what reset() and step() write, a row or an element per episode.
  auto observations() {
    return nb::ndarray<nb::numpy, double>(
        observations_.data(), {episodes_.size(), static_cast<std::size_t>(width_)}, nb::find(this));
  }
  auto rewards() {
    return nb::ndarray<nb::numpy, double>(rewards_.data(), {episodes_.size()}, nb::find(this));
  }
  auto lost() { return nb::ndarray<nb::numpy, bool>(lost_.get(), {episodes_.size()}, nb::find(this)); }
  /// Who takes part in step(): from reset() until lost, or until the caller has it otherwise.
  auto active() { return nb::ndarray<nb::numpy, bool>(active_.get(), {episodes_.size()}, nb::find(this)); }

  /// `numbers`, unless empty: of others of the population than configured.
  void reset(const std::vector<int>& which, const std::vector<std::uint64_t>& seeds,
             const std::vector<std::int64_t>& numbers) {
    if (seeds.size() != which.size() || (!numbers.empty() && numbers.size() != which.size()))
      throw nb::value_error("every episode that is reset has a seed, and a robot or none has");
    for (const int i : which) (void)at(i);
    each(static_cast<int>(which.size()), [&](int job) {
      const auto k = static_cast<std::size_t>(job);
      at(which[k]) = (numbers.empty() ? make_ : makes(numbers[k]))(seeds[k]);
      at(which[k])->observation(row(which[k]));
      const auto i = static_cast<std::size_t>(which[k]);
      rewards_[i] = 0.0;
      lost_[i] = false;
      active_[i] = true;
    });
  }
  /// Those that are active, by their actions, which are limited to -1 .. 1; how many of them are lost.
  int step(const Array& actions) {
    check(actions);
    std::atomic<int> losses{0};
    const auto one = [&](int i) {
      const auto k = static_cast<std::size_t>(i);
      const double* asked = actions.data() + std::ptrdiff_t{i} * wheels_;
      std::array<double, kMaxMotors> drive{};
      double acted = 0.0;
      for (std::size_t w = 0; w < static_cast<std::size_t>(wheels_); ++w) {
        drive[w] = std::clamp(asked[w], -1.0, 1.0);
        acted += drive[w] * drive[w];
      }
      const bool is_lost = !at(i)->step(drive.data());
      double* observation = row(i);
      at(i)->observation(observation);
      double cost = action_cost_ * acted;
      for (std::size_t n = 0; n < weights_.size(); ++n) {
        const double error = weights_[n] * observation[n];
        cost += error * error;
      }
      rewards_[k] = is_lost ? 0.0 : 1.0 - std::min(cost, 1.0);
      if (!is_lost) return;
      lost_[k] = true;
      active_[k] = false;
      ++losses;
    };
    each(count(), [&](int i) {
      if (active_[static_cast<std::size_t>(i)]) one(i);
    });
    return losses;
  }
  StateView truth(int i) { return at(i)->truth(); }

 private:
  using Make = std::function<std::unique_ptr<Episode>(std::uint64_t)>;

  Make makes(std::int64_t number) const {
    if (number == request_.robot) return make_;
    app::SimRequest request = request_;
    request.robot = number;
    app::check(request);
    return robot_.episodes(request, engine_);
  }
  /// On all threads; engines in Python one by one, under its lock.
  void each(int jobs, const std::function<void(int)>& job) {
    if (engine_) {
      for (int i = 0; i < jobs; ++i) job(i);
      guarded_.rethrow();
    } else {
      const nb::gil_scoped_release others;
      workers_.each(jobs, job);
    }
  }
  int width() const { return width_; }
  double* row(int i) {
    return &observations_[static_cast<std::size_t>(i) * static_cast<std::size_t>(width_)];
  }
  void check(const Array& actions) const {
    if (actions.ndim() != 2 || static_cast<int>(actions.shape(0)) != count() ||
        static_cast<int>(actions.shape(1)) != wheels_)
      throw nb::value_error(("actions: expected " + std::to_string(count()) + " rows of " +
                             std::to_string(wheels_) + " numbers")
                                .c_str());
  }
  std::unique_ptr<Episode>& at(int i) {
    if (i < 0 || i >= count()) throw nb::index_error("no such episode");
    return episodes_[static_cast<std::size_t>(i)];
  }

  app::SimRequest request_;
  Guarded guarded_;
  Simulated::MakeEngine engine_;
  const Simulated& robot_;
  Make make_;
  int width_ = static_cast<int>(robot_.observation_names().size());
  int wheels_ = robot_.wheels();
  std::vector<std::unique_ptr<Episode>> episodes_;
  std::vector<double> weights_;
  double action_cost_;
  std::vector<double> observations_, rewards_;
  std::unique_ptr<bool[]> lost_, active_;
  app::Workers workers_;  // gone first
};

}  // namespace equipoise::python
