// A three-motor robot on the fake board, wired as config/boards/robotics_cape_mbbr.toml.
#pragma once

#include <bbb.h>
#include <gmock/gmock.h>

#include <functional>
#include <string>
#include <vector>

#include "fake_gpio.hpp"
#include "syscall_journal.hpp"
#include "testbed.hpp"

class BoardFixture : public Testbed {
 protected:
  void SetUp() override;
  void TearDown() override { rio_close(&io_); }

  void resetBoard();  // the configuration and the fakes, not the files
  void open();
  rio_sensors_t tickAndRead();  // with a data-ready edge
  int write(double first, double second, double third);
  std::vector<std::string> duties() const;
  FakeGpio::Line& enableLine() { return FakeGpio::instance().line("44e07000", 20); }
  void expectMotorsOff();

  bbb_config_t config_{};
  rio_t io_{};
  std::string pwm_[2], counter_[3], adc_;
  int64_t edge_ns_ = 0;
};
