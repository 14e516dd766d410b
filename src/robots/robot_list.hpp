// The robots of this build: one line each; nothing else tells them apart by name. In: the name in a
// configuration -> out: f(firmware). Start-up only.
#pragma once

#include <string>
#include <tuple>
#include <type_traits>

#include "robots/mbbr/firmware.hpp"
#include "robots/mip/firmware.hpp"

namespace equipoise {

using Robots = std::tuple<MbbrFirmware,  //
                          MipFirmware>;

/// f(firmware) for every robot.
template <class F>
void for_each_robot(F&& f) {
  std::apply([&](auto... firmware) { (f(firmware), ...); }, Robots{});
}

/// f(firmware) for the robot named `type`; ConfigError when there is none. `where`: file, for the message.
template <class F, std::size_t I = 0>
auto with_robot(const std::string& type, const std::string& where, F&& f)
    -> std::invoke_result_t<F, std::tuple_element_t<0, Robots>> {
  using Firmware = std::tuple_element_t<I, Robots>;
  if (type == Firmware::kName) return f(Firmware{});
  if constexpr (I + 1 < std::tuple_size_v<Robots>) {
    return with_robot<F, I + 1>(type, where, std::forward<F>(f));
  } else {
    std::string names;
    for_each_robot([&](auto each) { names += (names.empty() ? "" : ", ") + std::string(each.kName); });
    throw ConfigError(where + ": robot.type: \"" + type + "\" is no robot of this build; allowed: " + names);
  }
}

}  // namespace equipoise
