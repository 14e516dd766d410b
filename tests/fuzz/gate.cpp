// Past authentication: holders' own keys sign whatever the fuzzer wants said, at any time, in any order. What
// the gate obeys must be what the protocol allows (docs/commands.md), by an account of its own.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <map>
#include <set>
#include <vector>

#include "equipoise/runtime/command_auth.hpp"

namespace {

using namespace equipoise::runtime;
using equipoise::command_session_t;
using equipoise::signed_command_t;

constexpr std::int64_t kTimeout_ms = 500;

/// Takes numbers off the fuzzer's bytes.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), left_(size) {}
  explicit operator bool() const { return left_ > 0; }
  std::uint8_t byte() {
    if (left_ == 0) return 0;
    --left_;
    return *data_++;
  }
  template <class Number>
  Number number() {
    Number value{};
    const std::size_t size = left_ < sizeof value ? left_ : sizeof value;
    std::memcpy(&value, data_, size);
    data_ += size;
    left_ -= size;
    return value;
  }

 private:
  const std::uint8_t* data_;
  std::size_t left_;
};

void check(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const CommandKeys keys = CommandKeys::of_robot("robot", CommandKey({1, 2, 3}));
  CommandGate gate(keys, kTimeout_ms);
  Bytes bytes(data, size);
  std::int64_t now_ms = 0;
  std::map<std::int64_t, std::int64_t> newest;  // sequence, by sender
  std::map<std::int64_t, std::int64_t> heard;
  std::set<std::vector<std::uint8_t>> obeyed;
  std::vector<signed_command_t> said;
  bool armed_by_somebody = false;
  while (bytes) {
    const std::uint8_t how = bytes.byte();
    now_ms += (how & 3U) == 0 ? bytes.byte() : (how & 3U);
    signed_command_t m{};
    const CommandWish before = gate.wish();
    if ((how & 4U) != 0 && !said.empty()) {
      m = said[bytes.byte() % said.size()];  // once more
    } else {
      m.session = gate.announcement(now_ms, command_session_t::OFF).session;
      if ((how & 8U) != 0) m.session ^= bytes.byte();
      m.heard_ms = (how & 16U) != 0 ? bytes.number<std::int64_t>() : now_ms - bytes.byte() * 4;
      m.sender = (how & 32U) != 0 ? bytes.number<std::int64_t>() : 1 + (bytes.byte() & 15);
      m.sequence = (how & 64U) != 0 ? bytes.number<std::int64_t>() : newest[m.sender] + (bytes.byte() % 4);
      m.turn = before.turn - ((how & 128U) != 0 ? bytes.byte() % 3 : 0);
      m.action = static_cast<std::int8_t>(bytes.byte() % 6);
      m.velocity_W_m_s[0] = static_cast<double>(bytes.number<float>());
      m.yaw_rate_rad_s = static_cast<double>(bytes.number<float>());
      set_name("anna", &m.holder);
      sign(keys, "robot", &m);
      said.push_back(m);
    }
    const std::int64_t session = gate.announcement(now_ms, command_session_t::OFF).session;
    const CommandGate::Verdict verdict = gate.accept(m, now_ms);
    const CommandWish& wish = gate.wish();
    if (verdict != CommandGate::Verdict::kRefused) {
      check(m.session == session);
      check(m.heard_ms >= 0 && m.heard_ms <= now_ms && now_ms - m.heard_ms <= kTimeout_ms);
      check(m.sender != 0 && std::isfinite(m.velocity_W_m_s[0]) && std::isfinite(m.yaw_rate_rad_s));
      // A place is given away when its owner's messages are all too old: then he may begin anew.
      const bool forgotten = now_ms - heard[m.sender] > kTimeout_ms;
      check(m.sequence > 0 && (forgotten || m.sequence > newest[m.sender]));
      newest[m.sender] = m.sequence;
      heard[m.sender] = m.heard_ms;
    }
    if (verdict != CommandGate::Verdict::kObeyed) {  // nothing changes
      check(wish.turn == before.turn && wish.arm == before.arm && wish.arms == before.arms &&
            wish.disarms == before.disarms && wish.heading_resets == before.heading_resets &&
            wish.yaw_rate_rad_s == before.yaw_rate_rad_s && wish.heard_ms == before.heard_ms);
      continue;
    }
    check(obeyed.insert({std::begin(m.mac), std::end(m.mac)}).second);  // never twice
    check(m.turn == before.turn && m.action != signed_command_t::ASK);
    const bool drive = m.action == signed_command_t::DRIVE;
    check(wish.turn == before.turn + (drive ? 0 : 1));
    check(wish.velocity_W_m_s[0] == (drive ? m.velocity_W_m_s[0] : 0.0));
    if (m.action == signed_command_t::ARM) armed_by_somebody = true;
    if (m.action == signed_command_t::DISARM) armed_by_somebody = false;
    check(wish.arm == armed_by_somebody);
    if (m.action == signed_command_t::ARM) check(wish.arm_until_ms == m.heard_ms + kTimeout_ms);
  }
  return 0;
}
