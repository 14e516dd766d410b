// Robots that are reset and stepped together, on several threads: what the Gymnasium environments call. In:
// request, actions -> out: observations, rewards, who is lost, in the caller's arrays. Simulation only.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <array>

#include "app/sim/workers.hpp"
#include "python/simulation.hpp"
#include "robots/lanes/roll.hpp"

namespace equipoise::python {

namespace nb = nanobind;

using Array = nb::ndarray<double, nb::numpy, nb::c_contig, nb::device::cpu>;

class Episodes {
 public:
  using Flags = nb::ndarray<bool, nb::numpy, nb::ndim<1>>;
  using Numbers = nb::ndarray<double, nb::numpy, nb::ndim<1>>;

  /// A tick upright is worth 1, less the squares of the weighted observation and those of the action times
  /// `action_cost`, down to 0; where the robot is lost it is worth nothing.
  Episodes(const app::SimRequest& request, int count, int jobs, std::vector<double> weights,
           double action_cost)
      : request_(request),
        robot_(simulated(robot_type(request.config))),
        make_((app::check(request), robot_.episodes(request))),
        episodes_(static_cast<std::size_t>(count)),
        weights_(std::move(weights)),
        action_cost_(action_cost),
        workers_(std::min(app::threads_for(jobs), static_cast<unsigned>(std::max(count, 1)))) {
    if (static_cast<int>(weights_.size()) != width())
      throw nb::value_error("every number of the observation has a weight");
  }

  Episodes(const Episodes&) = delete;
  Episodes& operator=(const Episodes&) = delete;

  int count() const { return static_cast<int>(episodes_.size()); }
  int wheels() const { return wheels_; }

  /// `numbers`, unless empty: of others of the population than configured. Their rows of `observations` are
  /// written.
  void reset(const std::vector<int>& which, const std::vector<std::uint64_t>& seeds,
             const std::vector<std::int64_t>& numbers, const Array& observations) {
    check(observations, width(), "observations");
    if (seeds.size() != which.size() || (!numbers.empty() && numbers.size() != which.size()))
      throw nb::value_error("every episode that is reset has a seed, and a robot or none has");
    for (const int i : which) (void)at(i);
    const nb::gil_scoped_release others;
    workers_.each(static_cast<int>(which.size()), [&](int job) {
      const auto k = static_cast<std::size_t>(job);
      at(which[k]) = (numbers.empty() ? make_ : makes(numbers[k]))(seeds[k]);
      at(which[k])->observation(row(observations, which[k]));
    });
  }
  /// Those of `active` are stepped by their actions, which are limited to -1 .. 1; their elements of the rest
  /// are written.
  void step(const Array& actions, const Flags& active, const Array& observations, const Numbers& rewards,
            const Flags& lost) {
    check(actions, wheels_, "actions");
    check(observations, width(), "observations");
    for (const std::size_t n : {rewards.shape(0), lost.shape(0), active.shape(0)}) {
      if (static_cast<int>(n) != count())
        throw nb::value_error("active, rewards and lost have an element per episode");
    }
    const nb::gil_scoped_release others;
    const auto one = [&](int i) {
      const double* asked = actions.data() + std::ptrdiff_t{i} * wheels_;
      std::array<double, kMaxMotors> drive{};
      double acted = 0.0;
      for (std::size_t w = 0; w < static_cast<std::size_t>(wheels_); ++w) {
        drive[w] = std::clamp(asked[w], -1.0, 1.0);
        acted += drive[w] * drive[w];
      }
      const bool is_lost = !at(i)->step(drive.data());
      double* observation = row(observations, i);
      at(i)->observation(observation);
      double cost = action_cost_ * acted;
      for (std::size_t k = 0; k < weights_.size(); ++k) {
        const double error = weights_[k] * observation[k];
        cost += error * error;
      }
      rewards(i) = is_lost ? 0.0 : 1.0 - std::min(cost, 1.0);
      if (lost(i) != is_lost) lost(i) = is_lost;  // one cache line of all threads: left alone where it can be
    };
    // In groups that fill the vector registers, as far as every thread has one; nobody's numbers depend on
    // them.
    const int group = std::clamp((count() + workers_.threads() - 1) / workers_.threads(), 1, kRobotsTogether);
    workers_.each((count() + group - 1) / group, [&](int job) {
      const int end = std::min(count(), (job + 1) * group);
      std::array<Episode*, kRobotsTogether> members{};
      int n = 0;
      for (int i = job * group; i < end; ++i) {
        if (active(i)) members[static_cast<std::size_t>(n++)] = at(i).get();
      }
      robot_.advance_together(members.data(), n);
      for (int i = job * group; i < end; ++i) {
        if (active(i)) one(i);
      }
    });
  }
  StateView truth(int i) { return at(i)->truth(); }

 private:
  using Make = std::function<std::unique_ptr<Episode>(std::uint64_t)>;

  Make makes(std::int64_t number) const {
    if (number == request_.robot) return make_;
    app::SimRequest request = request_;
    request.robot = number;
    app::check(request);
    return robot_.episodes(request);
  }
  int width() const { return width_; }
  double* row(const Array& observations, int i) const {
    return &observations.data()[std::ptrdiff_t{i} * width()];
  }
  void check(const Array& array, int columns, const char* name) const {
    if (array.ndim() != 2 || static_cast<int>(array.shape(0)) != count() ||
        static_cast<int>(array.shape(1)) != columns)
      throw nb::value_error((std::string(name) + ": expected " + std::to_string(count()) + " rows of " +
                             std::to_string(columns) + " numbers")
                                .c_str());
  }
  std::unique_ptr<Episode>& at(int i) {
    if (i < 0 || i >= count()) throw nb::index_error("no such episode");
    return episodes_[static_cast<std::size_t>(i)];
  }

  app::SimRequest request_;
  const Simulated& robot_;
  Make make_;
  int width_ = static_cast<int>(robot_.observation_names().size());
  int wheels_ = robot_.wheels();
  std::vector<std::unique_ptr<Episode>> episodes_;
  std::vector<double> weights_;
  double action_cost_;
  app::Workers workers_;  // gone first
};

}  // namespace equipoise::python
