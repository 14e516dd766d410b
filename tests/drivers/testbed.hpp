// A BeagleBone's /sys and /dev in a temporary directory (umockdev), one per test. In: which devices exist.
// Out: what the drivers wrote to their attributes. The I2C bus answers through FakeImu.
#pragma once

#include <gtest/gtest.h>
#include <umockdev.h>

#include <atomic>
#include <map>
#include <string>

#include "fake_imu.hpp"

class Testbed : public ::testing::Test {
 protected:
  Testbed();
  ~Testbed() override;

  // Each returns the attribute directory below /sys, usable with attribute() and setAttribute().
  std::string addPwm(const std::string& address, int chip, bool beagle_names = false);
  std::string addCounter(const std::string& address, int number);
  std::string addLegacyEqep(const std::string& address);
  std::string addAdc(const std::string& name, int number);
  std::string addLed(const std::string& name);
  std::string addTty(const std::string& address, const std::string& name);  // no node in /dev
  void addNet(const std::string& address, const std::string& name);         // an interface by its controller
  void addGpioChip(const std::string& address, int number);                 // no node in /dev
  void addGpioNode(const std::string& name, const std::string& label);  // a node alone, which tells its label
  void addImu(int bus = 2);
  void addBoard();  // all a robot with three motors needs
  std::string addDevice(const std::string& subsystem, const std::string& path,
                        const std::map<std::string, std::string>& attributes);
  std::string hostPath(const std::string& path) const;  // where it is in the temporary directory

  std::string attribute(const std::string& dir, const std::string& name) const;  // first line
  void setAttribute(const std::string& dir, const std::string& name, const std::string& value);
  void removeAttribute(const std::string& dir, const std::string& name);
  void removeDevice(const std::string& dir);
  std::string writeFile(const std::string& name, const std::string& content);  // path for open()

  FakeImu imu;
  std::atomic<bool> plain_i2c = true;  // what I2C_FUNCS promises; umockdev reads it in a thread of its own

 private:
  static gboolean onIoctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self);
  static gboolean onLabelIoctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self);
  void addNode(const std::string& name, const std::string& subsystem, GCallback answer);

  UMockdevTestbed* testbed_;
  std::map<std::string, UMockdevIoctlBase*> ioctl_;  // by node
  std::string gpio_label_;
  std::string scratch_;
};
