// Which sensor is faulty? One filter per hypothesis runs beside the one that uses every sensor
// (multiple-model estimation: Magill 1965). A hypothesis' log-likelihood ratio is summed since it was last
// refuted (CUSUM: Page 1954); beyond a bound, which a rate of false alarms gives (Lorden 1971), the one that
// leads all others by a margin changes which sensors are used; else none is trusted. Slipping and pushes are
// hypotheses, too, of healthy robots. Derivation and constants: docs/faults.md. In: input, Measurement ->
// out: the control's filter, which sensors it uses, whether they can be trusted. Filter: its EKF. RT-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "equipoise/estimate/evidence.hpp"
#include "equipoise/estimate/fault_hypotheses.hpp"
#include "equipoise/estimate/fault_member.hpp"
#include "equipoise/estimate/gross_samples.hpp"
#include "equipoise/estimate/health.hpp"
#include "equipoise/estimate/roll_watch.hpp"
#include "equipoise/estimate/used_sensors.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

template <class Filter, int Wheels>
class SensorFaults {
 public:
  using Sample = Measurement<Wheels>;
  using Model = typename Filter::Model;
  using Input = Vec<Model::kInputs>;
  static constexpr auto kHypotheses = fault_hypotheses<Wheels>();
  static constexpr std::size_t kCount = kHypotheses.size();

  /// `filter`: with the noise that there is, not what margins ask for.
  SensorFaults(const Filter& filter, const SensorFaultsParams& params)
      : p_(params),
        gross_(params.balances, params.slowly_rad_s),
        weigh_(params.evidence),
        noise_(filter),
        healthy_(with_noise(filter, params)),
        before_(healthy_),
        predicted_(healthy_),
        members_(filled(healthy_, std::make_index_sequence<kCount>())) {
    noise_.shake(members_[kNoise].filter, Member::kNoise_rad_s, Member::kNoise_m_s2);
    reset(filter, 0.0);
  }

  /// Motors off: every sensor is used again. `rest_sigma_rad_s`: of the gyro, while the robot was at rest.
  void reset(const Filter& control, double rest_sigma_rad_s) noexcept {
    healthy_.adopt(control);
    used_ = Used{};
    evidence_ = {-1, 0.0, kBound, -1, 0.0, false, evidence_.verdicts};
    gross_.reset();
    weigh_.reset(rest_sigma_rad_s);
    roll_.reset();
    trusted_ = true;
    ticks_ = jumps_ = event_at_ = leads_for_ = 0;
    wired_ = 0;
    rocks_at_ = -kRocking;
    stale_ = true;
  }

  /// One tick of `control`, which goes on without what is found faulty. `expected_rad_s`: rates of the body.
  void step(Filter& control, const Input& u, const Sample& raw, const Vec3& expected_rad_s) noexcept {
    evidence_ = {-1, 0.0, kBound, -1, 0.0, false, ticks_++ == 0 ? 0 : evidence_.verdicts};
    ran_ = 2;
    const Sample z = gross_.without(raw, expected_rad_s + used_.bias_rad_s);
    hear_noise(control);
    used_.predict(control, u);
    control.update(used_.with_axes(rocking()).of(z));
    if (!raw.imu_ok || !raw.encoders_ok) {  // nothing to weigh against each other
      used_.predict(healthy_, u);
      healthy_.update(used_.of(z));
      weigh_.forget();
      stale_ = true;
      return;
    }
    if (stale_) begin_all();
    advance_all(u, z);
    weigh_.hear(z);
    decide(control, expected_rad_s);
    if (kRocks && trusted_) watch_roll(control, expected_rad_s);
  }

  /// What the verdicts are compared with.
  const Filter& healthy() const noexcept { return healthy_; }
  bool trusted() const noexcept { return trusted_ && gross_.trusted(); }
  std::uint32_t excluded_wheels() const noexcept { return used_.without_wheels; }
  bool gyro_axis_excluded() const noexcept {
    return ((used_.without_axes & ~rocking()) | used_.swapped) != 0 || gross_.left_out();
  }
  int bias_jumps() const noexcept { return jumps_; }
  /// A fault leads: what surprises the control's filter is about to be explained.
  bool suspects() const noexcept { return suspects_; }
  /// Encoders that are wired backwards: found soon after arming, or two of which one is.
  std::uint32_t wired_backwards() const noexcept { return wired_; }
  /// Filters that ran in this tick.
  int ran() const noexcept { return ran_; }
  double ratio(std::size_t hypothesis) const noexcept { return members_[hypothesis].ratio; }
  const FaultEvidence& evidence() const noexcept { return evidence_; }

 private:
  using Evidence = equipoise::Evidence<Filter, Wheels>;
  using Used = UsedSensors<Wheels>;
  using Member = FaultMember<Filter, Wheels>;
  static constexpr auto kRows = fault_rows<Wheels>();
  static constexpr bool kRocks = kRocksOn<Wheels>;
  static constexpr std::size_t kNoise = fault_index<Wheels>(FaultHypothesis::kNoise);
  static constexpr std::uint32_t kAhead = 1U << 1;  // the gyro's axis about which it rocks

  // Decisions, in nats. A false alarm in ten hours of ticks and sixteen hypotheses: ln(7.2e6 * 16)
  // (Lorden 1971).
  static constexpr double kBound = 18.6;
  static constexpr double kMargin = 5.0;  // odds of 150 to 1
  // A push or slip a minute, a fault in 100 hours; wiring as much rarer again, three times so in motion.
  static constexpr double kEventPrior = 9.0;
  static constexpr int kPatience = 20;      // ticks for one verdict to lead; a tilt grows by half in them
  static constexpr int kEventTicks = 20;    // a push or slip is over: what goes on slowly is none
  static constexpr int kShownTicks = 200;   // a bias that jumps has moved the tilt by 0.1 rad
  static constexpr int kArmingTicks = 100;  // a push of the hand that lets go is over
  static constexpr int kRocking = 400;      // no body rocks for longer
  static constexpr double kJump_rad_s = 0.3;
  static constexpr double kBias_rad_s = 0.1;  // uncertain after a jump: the noise of one sample

  static Filter with_noise(Filter filter, const SensorFaultsParams& p) {
    for (std::size_t i = 0; i < 3; ++i)
      filter.set_row_noise(i, std::max(filter.row_noise(i), std::pow(p.evidence.gyro_sigma_rad_s[i], 2)));
    for (std::size_t i = Evidence::kWheelRow; i < Evidence::kAccelRow; ++i)
      filter.set_row_noise(i, p.evidence.encoder_sigma_rad * p.evidence.encoder_sigma_rad);
    return filter;
  }
  template <std::size_t... I>
  static std::array<Member, kCount> filled(const Filter& filter, std::index_sequence<I...>) {
    return {((void)I, Member{filter})...};
  }

  /// An eduMIP's control takes what vibrates for noise. An MBBR's follows it, for with less weight on the
  /// gyro three wheels that slip lead it astray; its IMU is noisier only while that hypothesis leads.
  void hear_noise(Filter& control) const noexcept {
    if (kRocks) return noise_.vibrate(control, weigh_.vibration_rad_s());
    const bool leads = leader_ == kNoise && members_[kNoise].ratio > 0.0;
    noise_.shake(control, leads ? weigh_.vibration_rad_s() : 0.0, leads ? Member::kNoise_m_s2 : 0.0);
  }

  void begin_all() noexcept {
    for (std::size_t i = 0; i < kCount; ++i) begin(i, healthy_, healthy_);
    stale_ = suspects_ = false;
    undecided_ = leads_for_ = 0;
  }
  /// `state`: that, or what it has predicted since, which is the same for all.
  void begin(std::size_t i, const Filter& from, const Filter& state) noexcept {
    const FaultHypothesis& h = kHypotheses[i];
    Member& m = members_[i];
    m.filter.adopt(state);
    m.owes = m.apart = false;
    m.used = used_.turned_over(h);
    if (h.kind == FaultHypothesis::kSwap) m.used.swap_sign = p_.axis_sign(h.first()) * p_.axis_sign(h.last());
    const bool wheel_returns = h.kind == FaultHypothesis::kWheel && (used_.without_wheels & h.mask) != 0;
    if (wheel_returns && weigh_.known())
      m.used.offset_rad(h.first()) =
          before_.wheel_angle_rad()(h.first()) - weigh_.before().wheel_angle_rad(h.first());
    if (m.used.reversed >= 0) m.used.mirror_rad = from.wheel_angle_rad()(m.used.reversed);
    m.ratio = h.waits() ? -kMargin : 0.0;
    m.since = ticks_;
    m.from_start = ticks_ <= kArmingTicks;
    m.returns = wheel_returns ? Model::kWheel + h.first() : -1;
    if (h.kind == FaultHypothesis::kAxis && (used_.without_axes & ~rocking() & h.mask) != 0)
      m.returns = h.first();
    if (m.returns >= 0) m.from = Evidence::reading(weigh_.before(), static_cast<std::size_t>(m.returns));
  }

  void advance_all(const Input& u, const Sample& z) noexcept {
    before_.adopt(healthy_);
    noise_.vibrate(healthy_, weigh_.vibration_rad_s(), p_.evidence.gyro_sigma_rad_s);
    used_.predict(healthy_, u);
    predicted_.adopt(healthy_);
    const Sample used = used_.of(z);
    healthy_.update(used);
    const double as_used = weigh_.expect(healthy_, used, z);
    for (Member& m : members_) m.apart = m.apart || weigh_.knows_less();
    for (std::size_t i = 0; i < kCount; ++i) {
      if (open(kHypotheses[i])) advance(i, u, z, used, as_used);
    }
    weigh_.learn_vibration(healthy_, used);
  }

  /// `all`: as healthy_ has used it.
  void advance(std::size_t i, const Input& u, const Sample& z, const Sample& all, double as_used) noexcept {
    const FaultHypothesis& h = kHypotheses[i];
    Member& m = members_[i];
    if (h.kind == FaultHypothesis::kBias &&
        Evidence::off_rad_s(healthy_, all, p_.balances) > weigh_.least_jump_rad_s()) {
      // A jump of the gyro's bias (Willsky and Jones 1976)? What it follows already is no new one.
      const double nats = weigh_.jump(healthy_, all, kJump_rad_s);
      if (m.ratio <= -kMargin && nats > -kMargin) return jumped(i, u, z, nats);
    }
    const bool anew = m.ratio <= -kMargin || is_over(i);
    if (anew && (h.waits() || (h.kind == FaultHypothesis::kReversed && ticks_ > kArmingTicks &&
                               !(members_[i - Wheels].ratio > 0.0))))  // wiring does not change in motion
      return m.refute(-kMargin);
    if (!h.waits()) {
      if constexpr (kRocks) {
        if (anew && h.healthy()) members_[fault_index<Wheels>(FaultHypothesis::kEvent)].keep(m);
      }
      if (m.is_needless(h, weigh_, healthy_, all, z, anew, as_used, -kMargin)) return m.refute(-kMargin);
    }
    ++ran_;
    if (i != kNoise) noise_.vibrate(m.filter, weigh_.vibration_rad_s(), p_.evidence.gyro_sigma_rad_s);
    if (anew) begin(i, before_, predicted_);
    if (!anew) m.used.predict(m.settled(), u);
    m.allow(h);
    const Sample used = m.used.of(z);
    m.innovate(used);
    double gain = weigh_(m.filter, used, z) - as_used;
    if (kRocks && h.of_imu()) gain -= weigh_.within_a_sigma();
    if (m.returns >= 0) gain = std::min(gain, weigh_.unless_faulty(m.filter, used, z, m.returns, m.from));
    // A fault beside which a wheel still has to slip explains nothing; only swapped axes make a robot slip.
    const bool explains = h.healthy() || h.kind == FaultHypothesis::kSwap || !m.filter.slipped();
    m.ratio += explains ? gain : std::min(gain, 0.0);
    if (!(m.ratio > 0.0)) m.since = ticks_;
    if (!(m.ratio > -kMargin)) m.refute(-kMargin);
    if (h.kind == FaultHypothesis::kBias && jump_rad_s(m) < weigh_.least_jump_rad_s()) m.refute(-kMargin);
  }

  /// Of the gyro's bias, on the axis that it has moved most. What is smaller the filter's own bias learns:
  /// the hypothesis would live on the freedom to do so.
  double jump_rad_s(Member& m) const noexcept {
    Vec3 d = m.used.bias_rad_s - used_.bias_rad_s;
    for (int k = 0; k < Filter::kBiases; ++k) d(k) += m.settled().gyro_bias(k) - healthy_.gyro_bias(k);
    return d.cwiseAbs().maxCoeff();
  }

  void jumped(std::size_t i, const Input& u, const Sample& z, double ratio) noexcept {
    begin(i, before_, before_);
    Member& m = members_[i];
    const Sample used = used_.of(z);
    m.used.bias_rad_s += Evidence::gyro_innovation(healthy_, used);
    if (kRocks) m.used.bias_rad_s.y() = used_.bias_rad_s.y();  // what that axis reads, the floor may do
    m.filter.doubt_bias(kBias_rad_s);
    m.filter.predict(u);
    m.filter.update(m.used.of(z));
    m.ratio = ratio;
  }

  /// The axis ahead is left out while the body rocks, from the evidence only, and no fault.
  std::uint32_t rocking() const noexcept { return kRocks && ticks_ - rocks_at_ < kRocking ? kAhead : 0U; }
  void watch_roll(const Filter& control, const Vec3& rates_rad_s) noexcept {
    constexpr std::size_t kBias = fault_index<Wheels>(FaultHypothesis::kBias);
    roll_.hear(control.row_innovation()[1], rates_rad_s.z());
    if (!roll_.trusted()) return stop(kBias, kBias);
    if (ticks_ - rocks_at_ == kRocking) tell(fault_index<Wheels>(FaultHypothesis::kAxis) + 1);
  }
  /// What is held to be faulty from this tick on.
  void tell(std::size_t hypothesis) noexcept {
    evidence_.leading = kRows[hypothesis];
    const std::uint32_t verdicts = used_.with_axes(rocking()).verdicts();
    evidence_.decided = verdicts != evidence_.verdicts;
    evidence_.verdicts = verdicts;
  }

  enum Consequence { kNone = -1, kStop = -2, kFollow = -3 };  // else the hypothesis' own
  int consequence(std::size_t i) const noexcept {
    const FaultHypothesis& h = kHypotheses[i];
    if (h.healthy()) return kNone;
    const bool gyro = h.kind == FaultHypothesis::kSwap ||
                      (h.kind == FaultHypothesis::kAxis && (used_.without_axes & h.mask) == 0);
    if ((gyro && p_.balance(h.mask)) || h.kind == FaultHypothesis::kImu) return kStop;
    if (h.kind == FaultHypothesis::kBias || h.kind == FaultHypothesis::kDrift) return kFollow;
    return h.kind == FaultHypothesis::kReversed ? h.first() : static_cast<int>(i);  // as kWheel
  }
  /// Leaving out each axis that is read wrongly.
  bool left_out_explains(const FaultHypothesis& swap) const noexcept {
    for (std::size_t i = 0; i < kCount; ++i) {
      const bool its =
          kHypotheses[i].kind == FaultHypothesis::kAxis && (kHypotheses[i].mask & swap.mask) != 0;
      if (its && !(members_[i].ratio > 0.0)) return false;
    }
    return true;
  }
  /// A push or slip is; so is a fault by which the robot would have all but fallen, had it been one.
  bool is_over(std::size_t i) const noexcept {
    const FaultHypothesis& h = kHypotheses[i];
    const int age = ticks_ - members_[i].since;
    if (h.healthy()) return h.kind != FaultHypothesis::kEvent && age > kEventTicks;
    if (age <= kShownTicks || weighed(i) > kBound) return false;
    return h.kind == FaultHypothesis::kBias || (h.kind == FaultHypothesis::kSwap && p_.balance(h.mask));
  }
  bool open(const FaultHypothesis& h) const noexcept {
    return used_.leaves_open(h) && (p_.bias_drifts || h.kind != FaultHypothesis::kDrift);
  }
  double weighed(std::size_t i) const noexcept {
    const FaultHypothesis& h = kHypotheses[i];
    if (!open(h)) return -kMargin;
    const Member& m = members_[i];
    const bool can_wait = h.kind == FaultHypothesis::kSwap && !p_.balance(h.mask);
    if (can_wait) return left_out_explains(h) ? m.ratio - kEventPrior : -kMargin;
    if (h.wiring()) return m.ratio - (m.from_start ? 1.0 : 3.0) * kEventPrior;
    const bool may_be = h.healthy() && m.ratio > -kMargin && ticks_ - event_at_ > kEventTicks;
    return m.ratio + (may_be ? kEventPrior : 0.0);
  }

  void decide(Filter& control, const Vec3& believed_rad_s) noexcept {
    std::array<double, kCount> weight;
    for (std::size_t i = 0; i < kCount; ++i) weight[i] = weighed(i);
    const auto best =
        static_cast<std::size_t>(std::max_element(weight.begin(), weight.end()) - weight.begin());
    const int leads = consequence(best);
    suspects_ = leads != kNone && weight[best] > kMargin;
    double second = 0.0;
    std::size_t runner_up = best;
    for (std::size_t i = 0; i < kCount; ++i) {
      if (!(weight[i] > second) || consequence(i) == leads) continue;
      second = weight[i];
      runner_up = i;
    }
    const int next = runner_up == best ? -1 : kRows[runner_up];
    const auto told = [&](std::size_t i) { return std::min(weight[i], members_[i].ratio); };
    evidence_ = {kRows[best], told(best),        kBound, next, next < 0 ? 0.0 : told(runner_up),
                 false,       evidence_.verdicts};
    const bool tells = weight[best] > kBound;
    leads_for_ = best == leader_ && tells ? leads_for_ + 1 : 0;
    leader_ = best;
    undecided_ = tells ? undecided_ : 0;
    if (!tells) return;
    if (leads == kNone) return happened(best, control);
    if (weight[best] - second < kMargin) {
      if (!kHypotheses[runner_up].healthy() && ++undecided_ > kPatience) stop(best, runner_up);
      return;
    }
    const bool waits = kHypotheses[best].lasts(leads == kStop) && leads_for_ < kPatience;
    if (waits && !members_[best].is_urgent(believed_rad_s, kPatience)) return;
    if (leads == kStop) return stop(best, best);
    use(best);
    control.adopt(healthy_);
  }

  /// One of them is true; the robot cannot go on with either. Two reversed encoders say nothing against the
  /// gyro.
  void stop(std::size_t one, std::size_t other) noexcept {
    evidence_.leading = kRows[one];
    evidence_.decided = trusted_ && wired_ == 0;
    evidence_.verdicts |= 1U << kRows[one] | 1U << kRows[other];
    const FaultHypothesis &a = kHypotheses[one], &b = kHypotheses[other];
    const bool backwards = a.kind == FaultHypothesis::kReversed && b.kind == a.kind;
    if (backwards) wired_ |= a.mask | b.mask;
    trusted_ = trusted_ && backwards;
  }

  /// It was pushed, has slipped or is shaken: what is used goes on from there, and every suspicion with it.
  /// The control's filter takes pushes and slips by itself: it lets go of wheels that slip far
  /// (encoder_slip.hpp). Of noisier samples it has heard only since that led.
  void happened(std::size_t event, Filter& control) noexcept {
    healthy_.adopt(members_[event].settled());
    if (event == kNoise) control.adopt(healthy_);
    const double ratio = members_[event].ratio;
    for (Member& m : members_) m.depart(ratio, -kMargin);
    begin(event, healthy_, healthy_);
    undecided_ = 0;
    event_at_ = ticks_;
  }

  void use(std::size_t hypothesis) noexcept {
    const FaultHypothesis& h = kHypotheses[hypothesis];
    Member& m = members_[hypothesis];
    if (h.kind == FaultHypothesis::kReversed) {
      used_.backwards |= h.mask;
      used_.without_wheels |= h.mask;
      if (ticks_ <= kArmingTicks) wired_ |= h.mask;
    } else {
      used_ = m.used;
    }
    if (h.kind == FaultHypothesis::kBias) ++jumps_;
    if (kRocks && h.kind == FaultHypothesis::kBias) used_.bias_rad_s.y() += healthy_.row_innovation()[1];
    healthy_.adopt(m.settled());
    if (h.kind == FaultHypothesis::kAxis && h.mask == kAhead) rocks_at_ = ticks_;
    tell(hypothesis);
    begin_all();
  }

  SensorFaultsParams p_;
  GrossSamples gross_;
  Evidence weigh_;
  SampleNoise<Filter, Wheels> noise_;
  RollWatch roll_;
  Filter healthy_;    // with everything that is used
  Filter before_;     // a tick ago
  Filter predicted_;  // without this tick's samples
  std::array<Member, kCount> members_;
  Used used_;
  std::uint32_t wired_ = 0;  // wired_backwards()
  FaultEvidence evidence_;
  bool stale_ = true;  // members have missed a tick
  bool trusted_ = true, suspects_ = false;
  int ticks_ = 0, jumps_ = 0, ran_ = 1;                              // since arming; filters in this tick
  int event_at_ = 0, rocks_at_ = 0, undecided_ = 0, leads_for_ = 0;  // ticks
  std::size_t leader_ = 0;
};

}  // namespace equipoise
