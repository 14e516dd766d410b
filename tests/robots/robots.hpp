// The robots that tests of loop, log and replay run on: one line each.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "robots/cart_pendulum/firmware.hpp"

namespace equipoise {

using TestRobots = testing::Types<MbbrFirmware,  //
                                  MipFirmware,   //
                                  CartPendulumFirmware>;

}  // namespace equipoise
