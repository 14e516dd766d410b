#include "testbed.hpp"

#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "syscall_journal.hpp"

namespace fs = std::filesystem;

namespace {
constexpr int kImuAddress = 0x68;

std::unique_ptr<UMockdevIoctlData, decltype(&g_object_unref)> resolve(UMockdevIoctlData* from, size_t at,
                                                                      size_t size) {
  return {umockdev_ioctl_data_resolve(from, at, size, nullptr), &g_object_unref};
}

// Data of a UMockdevIoctlData; umockdev keeps it in public fields.
template <typename T>
T* as(const std::unique_ptr<UMockdevIoctlData, decltype(&g_object_unref)>& data) {
  return reinterpret_cast<T*>(data->data);
}
}  // namespace

Testbed::Testbed() : testbed_(umockdev_testbed_new()) {
  SyscallJournal::instance().clear();
  scratch_ = fs::temp_directory_path() / ("equipoise_drivers_" + std::to_string(getpid()));
  fs::create_directories(scratch_);
}

Testbed::~Testbed() {
  EXPECT_EQ(SyscallJournal::instance().inheritable(), 0);
  for (const auto& [node, ioctl] : ioctl_) {
    umockdev_testbed_detach_ioctl(testbed_, node.c_str(), nullptr);
    g_object_unref(ioctl);
  }
  g_object_unref(testbed_);
  fs::remove_all(scratch_);
}

std::string Testbed::hostPath(const std::string& path) const {
  char* root = umockdev_testbed_get_root_dir(testbed_);
  const std::string result = std::string(root) + path;
  g_free(root);
  return result;
}

// A device and its link in /sys/bus/SUBSYSTEM/devices or /sys/class/SUBSYSTEM, with the real depth of paths.
std::string Testbed::addDevice(const std::string& subsystem, const std::string& path,
                               const std::map<std::string, std::string>& attributes) {
  const std::string dir = "/sys/devices/platform/ocp/" + path;
  fs::create_directories(hostPath(dir));
  for (const auto& [name, value] : attributes) setAttribute(dir, name, value);
  const std::string link_dir =
      subsystem.front() == '@' ? "/sys/class/" + subsystem.substr(1) : "/sys/bus/" + subsystem + "/devices";
  fs::create_directories(hostPath(link_dir));
  const fs::path target = fs::relative(hostPath(dir), hostPath(link_dir));
  fs::create_symlink(target, hostPath(link_dir) + "/" + fs::path(path).filename().string());
  return dir;
}

std::string Testbed::addPwm(const std::string& address, int chip, bool beagle_names) {
  const std::string number = std::to_string(chip);
  std::map<std::string, std::string> attributes{{"npwm", "2"}, {"export", ""}, {"unexport", ""}};
  for (const char* channel : {"0", "1"}) {
    const std::string dir = beagle_names ? "pwm-" + number + ":" + channel : std::string("pwm") + channel;
    attributes[dir + "/period"] = "0";
    attributes[dir + "/duty_cycle"] = "0";
    attributes[dir + "/enable"] = "0";
  }
  return addDevice("@pwm", address + ".epwmss/" + address + ".pwm/pwm/pwmchip" + number, attributes);
}

std::string Testbed::addCounter(const std::string& address, int number) {
  return addDevice("counter", address + ".counter/counter" + std::to_string(number),
                   {{"name", address + ".counter"},
                    {"count0/count", "0"},
                    {"count0/ceiling", "0"},
                    {"count0/enable", "0"},
                    {"count0/function", "quadrature x4"}});
}

std::string Testbed::addLegacyEqep(const std::string& address) {
  return addDevice("platform", address + ".eqep", {{"position", "0"}, {"enabled", "0"}, {"mode", "0"}});
}

std::string Testbed::addAdc(const std::string& name, int number) {
  std::map<std::string, std::string> attributes{{"name", name}};
  for (int i = 0; i < 8; ++i) attributes["in_voltage" + std::to_string(i) + "_raw"] = "0";
  return addDevice("iio", "44e0d000.adc/iio:device" + std::to_string(number), attributes);
}

std::string Testbed::addLed(const std::string& name) {
  return addDevice("@leds", "leds/" + name, {{"brightness", "0"}});
}

std::string Testbed::addTty(const std::string& address, const std::string& name) {
  return addDevice("@tty", address + ".serial/tty/" + name, {{"uevent", ""}});
}

void Testbed::addNet(const std::string& address, const std::string& name) {
  addDevice("@net", address + ".can/net/" + name, {});
}

void Testbed::addGpioChip(const std::string& address, int number) {
  addDevice("gpio", address + ".gpio/gpiochip" + std::to_string(number), {});
}

void Testbed::addNode(const std::string& name, const std::string& subsystem, GCallback answer) {
  const std::string node = "/dev/" + name;
  const std::string device = "P: /devices/platform/" + name + "/" + subsystem + "/" + name + "\nN: " + name +
                             "\nE: DEVNAME=" + node + "\nE: SUBSYSTEM=" + subsystem + "\n";
  GError* error = nullptr;
  ASSERT_TRUE(umockdev_testbed_add_from_string(testbed_, device.c_str(), &error)) << error->message;
  UMockdevIoctlBase* ioctl = ioctl_[node] = umockdev_ioctl_base_new();
  g_signal_connect(ioctl, "handle-ioctl", answer, this);
  ASSERT_TRUE(umockdev_testbed_attach_ioctl(testbed_, node.c_str(), ioctl, &error)) << error->message;
}

void Testbed::addGpioNode(const std::string& name, const std::string& label) {
  gpio_label_ = label;
  addNode(name, "gpio", G_CALLBACK(&Testbed::onLabelIoctl));
}

void Testbed::addImu(int bus) {
  addNode("i2c-" + std::to_string(bus), "i2c-dev", G_CALLBACK(&Testbed::onIoctl));
}

void Testbed::addBoard() {
  addImu();
  addPwm("48302200", 4);
  addPwm("48304200", 7);
  addCounter("48300180", 2);
  addCounter("48302180", 0);
  addCounter("48304180", 1);
  addAdc("TI-am335x-adc.0.auto", 0);
}

std::string Testbed::attribute(const std::string& dir, const std::string& name) const {
  std::ifstream file(hostPath(dir + "/" + name));
  std::string line;
  std::getline(file, line);
  return line;
}

void Testbed::setAttribute(const std::string& dir, const std::string& name, const std::string& value) {
  const std::string path = hostPath(dir + "/" + name);
  fs::create_directories(fs::path(path).parent_path());
  std::ofstream(path, std::ios::trunc) << value << "\n";
}

void Testbed::removeAttribute(const std::string& dir, const std::string& name) {
  fs::remove_all(hostPath(dir + "/" + name));
}

void Testbed::removeDevice(const std::string& dir) { fs::remove_all(hostPath(dir)); }

std::string Testbed::writeFile(const std::string& name, const std::string& content) {
  const std::string path = scratch_ + "/" + name;
  std::ofstream(path, std::ios::binary) << content;
  return path;
}

gboolean Testbed::onLabelIoctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer user) {
  UMockdevIoctlData* arg = umockdev_ioctl_client_get_arg(client);
  gpiochip_info info{};
  static_cast<Testbed*>(user)->gpio_label_.copy(info.label, sizeof info.label);
  const bool known =
      static_cast<uint32_t>(umockdev_ioctl_client_get_request(client)) == GPIO_GET_CHIPINFO_IOCTL;
  const auto out = resolve(arg, 0, sizeof info);
  if (known) umockdev_ioctl_data_update(out.get(), 0, reinterpret_cast<guint8*>(&info), sizeof info);
  umockdev_ioctl_client_complete(client, known ? 0 : -1, known ? 0 : ENOTTY);
  return TRUE;
}

gboolean Testbed::onIoctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer user) {
  Testbed& self = *static_cast<Testbed*>(user);
  UMockdevIoctlData* arg = umockdev_ioctl_client_get_arg(client);
  const auto request = static_cast<uint32_t>(umockdev_ioctl_client_get_request(client));
  if (request == I2C_FUNCS) {
    unsigned long functions = self.plain_i2c ? I2C_FUNC_I2C : I2C_FUNC_SMBUS_BYTE;
    const auto out = resolve(arg, 0, sizeof functions);
    umockdev_ioctl_data_update(out.get(), 0, reinterpret_cast<guint8*>(&functions), sizeof functions);
    umockdev_ioctl_client_complete(client, 0, 0);
    return TRUE;
  }
  if (request != I2C_RDWR) {
    umockdev_ioctl_client_complete(client, -1, ENOTTY);
    return TRUE;
  }
  const auto transfer = resolve(arg, 0, sizeof(i2c_rdwr_ioctl_data));
  const unsigned count = as<i2c_rdwr_ioctl_data>(transfer)->nmsgs;
  const auto messages = resolve(transfer.get(), offsetof(i2c_rdwr_ioctl_data, msgs), count * sizeof(i2c_msg));
  const int failure = self.imu.nextTransfer();
  const bool is_short = self.imu.nextIsShort();
  for (unsigned i = 0; failure == 0 && i < count; ++i) {
    const i2c_msg& message = as<i2c_msg>(messages)[i];
    if (message.addr != kImuAddress) {
      umockdev_ioctl_client_complete(client, -1, ENXIO);
      return TRUE;
    }
    const auto bytes = resolve(messages.get(), i * sizeof(i2c_msg) + offsetof(i2c_msg, buf), message.len);
    if ((message.flags & I2C_M_RD) == 0) {
      self.imu.write(bytes->data, message.len);
      continue;
    }
    std::vector<uint8_t> read(message.len);
    self.imu.read(read.data(), message.len);
    umockdev_ioctl_data_update(bytes.get(), 0, read.data(), message.len);
  }
  const long result = failure != 0 ? -1 : static_cast<long>(count) - (is_short ? 1 : 0);
  umockdev_ioctl_client_complete(client, result, failure);
  return TRUE;
}
