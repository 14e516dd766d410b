#include "app/board/board.hpp"

#include <cstring>
#include <filesystem>

#include "app/board/calibration_file.hpp"
#include "config/toml_reader.hpp"

namespace equipoise::app {
namespace {

using config::Document;
using config::Section;

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr int kMaxLine = 91;  // the AM62's main_gpio0 has 92 lines, a bank of the AM335x 32

void copy_text(Section& s, const std::string& key, char* to, std::size_t size) {
  const std::string value = s.text(key);
  if (value.size() >= size) s.fail(key, "is too long; allowed: " + std::to_string(size - 1) + " characters");
  std::memcpy(to, value.c_str(), value.size() + 1);
}

BoardLine read_line(Section& s, const std::string& key) {
  const auto [chip, line] = s.text_and_integer(key, 0, kMaxLine);
  if (chip.empty() || chip.size() >= BBB_NAME_MAX) {
    s.fail(key, "names no gpio chip; expected its address or label, e.g. \"44e07000\"");
  }
  return {chip, line};
}

bbb_pin_t read_pin(Section& s, const std::string& key, bool active_low = false) {
  const BoardLine line = read_line(s, key);
  bbb_pin_t pin{};
  pin.used = true;
  pin.line = static_cast<std::uint32_t>(line.line);
  pin.active_low = active_low;
  std::memcpy(pin.chip, line.chip.c_str(), line.chip.size() + 1);
  return pin;
}

int read_one_of(Section& s, const std::string& key, const std::vector<int>& values) {
  const int value = s.integer(key, values.front(), values.back());
  std::string allowed;
  for (const int each : values) {
    if (each == value) return value;
    allowed += (allowed.empty() ? "" : ", ") + std::to_string(each);
  }
  s.fail(key, std::to_string(value) + " is not possible; allowed: " + allowed);
}

/// The part, and of its low-pass settings one that the driver can choose.
void read_part(Section& s, bbb_imu_t* imu) {
  const bool iio = imu->driver == BBB_IMU_IIO;
  if (iio) {
    std::vector<std::string> names;
    names.reserve(IMU_PARTS);
    for (int i = 0; i < IMU_PARTS; ++i) names.emplace_back(imu_part(i)->name);
    imu->part = static_cast<int>(s.choice("part", names));
  }
  std::vector<int> settings;
  for (int i = 1; i <= IMU_LOW_PASS_MAX; ++i) {
    if (!iio || imu_low_pass(imu->part, i)->rate_hz >= imu->rate_hz) settings.push_back(i);
  }
  imu->dlpf = static_cast<std::uint8_t>(read_one_of(s, "low_pass", settings));
}

bbb_imu_t read_imu(Section s, BoardFacts* facts) {
  bbb_imu_t imu{};
  if (s.has("driver"))
    imu.driver = s.choice("driver", {"mpu9250", "iio"}) == 0 ? BBB_IMU_MPU9250 : BBB_IMU_IIO;
  imu.rate_hz = static_cast<std::uint16_t>(s.integer("rate_hz", 200, 200));
  read_part(s, &imu);
  imu.gyro_range_dps = static_cast<std::uint16_t>(read_one_of(s, "gyro_range_deg_s", {250, 500, 1000, 2000}));
  imu.accel_range_g = static_cast<std::uint16_t>(read_one_of(s, "accel_range_g", {2, 4, 8, 16}));
  imu.stuck_after = static_cast<std::uint16_t>(s.integer("stuck_after_samples", 0, 1000));
  imu.late_after_us = static_cast<std::uint32_t>(s.integer("late_after_us", 1, 5000));
  if (imu.driver == BBB_IMU_IIO) {
    if (s.has("trigger")) copy_text(s, "trigger", imu.trigger, sizeof imu.trigger);
  } else {
    copy_text(s, "bus", imu.bus, sizeof imu.bus);
    imu.address = static_cast<std::uint16_t>(s.integer("address", 0x08, 0x77));
    imu.interrupt = read_pin(s, "interrupt", s.boolean("interrupt_active_low"));
    copy_text(s, "dmp_firmware", imu.dmp_firmware, sizeof imu.dmp_firmware);
  }
  Eigen::Map<RowMajor>(facts->R_BS.data()) = s.rotation("R_BS");
  facts->gyro_delay_s = imu_low_pass(imu.part, imu.dlpf)->gyro_delay_s;
  facts->accel_delay_s = imu_low_pass(imu.part, imu.dlpf)->accel_delay_s;
  s.finish();
  return imu;
}

bbb_motor_t read_motor(Section& s) {
  bbb_motor_t motor{};
  motor.bridge = s.choice("bridge", {"mc33926", "tb6612"}) == 0 ? BBB_MC33926 : BBB_TB6612;
  motor.in1 = read_pin(s, "in1");
  motor.in2 = read_pin(s, "in2");
  if (s.has("fault")) motor.fault = read_pin(s, "fault", true);  // SF pulls low
  copy_text(s, "pwm", motor.pwm, sizeof motor.pwm);
  motor.pwm_channel = static_cast<std::uint32_t>(s.choice("pwm_channel", {"A", "B"}));
  motor.motor_reversed = s.boolean("motor_reversed");
  copy_text(s, "encoder", motor.encoder, sizeof motor.encoder);
  motor.encoder_reversed = s.boolean("encoder_reversed");
  s.finish();
  return motor;
}

/// Battery scale, and the channel's own entries.
void read_battery(Section s, Board* board) {
  copy_text(s, "adc", board->wiring.adc, sizeof board->wiring.adc);
  board->wiring.battery_channel = static_cast<std::uint32_t>(s.integer("channel", 0, 7));
  board->facts.battery_V_per_count = s.number("V_per_count", 1e-6, 1.0);
  board->facts.battery_offset_V = s.number("offset_V", -5.0, 5.0);
  board->wiring.battery_every_ticks = static_cast<std::uint32_t>(s.integer("every_ticks", 1, 200));
  s.finish();
}

void read_panel(Section& root, Board* board) {
  Section jack = root.table("dc_jack");
  jack.integer("channel", 0, 7);
  jack.number("V_per_count", 1e-6, 1.0);
  jack.number("offset_V", -5.0, 5.0);
  jack.finish();

  Section leds = root.table("leds");
  board->led_red = read_line(leds, "red");
  board->led_green = read_line(leds, "green");
  for (const auto& [chip, line] : leds.texts_and_integers("bars", 8, 0, kMaxLine))
    board->led_bars.push_back({chip, line});
  leds.finish();

  Section buttons = root.table("buttons");
  board->button_pause = read_line(buttons, "pause");
  board->button_mode = read_line(buttons, "mode");
  board->buttons_active_low = buttons.boolean("active_low");
  buttons.finish();

  Section serial = root.table("serial");
  board->serial_device = serial.text("device");
  board->serial_baud = read_one_of(serial, "baud", {9600, 19200, 38400, 57600, 115200});
  serial.finish();

  Section can = root.table("can");
  board->can_interface = can.text("interface");
  board->can_bitrate = can.integer("bitrate", 10000, 1000000);
  can.finish();
}

Board read_board(const Document& document) {
  Section root(document, document.root(), "");
  Board board;
  board.facts.file = document.path();
  Section about = root.table("board");
  board.robot = about.text("robot");
  constexpr std::array<const char*, 3> kOverlays{"cape", "blue", "none"};
  board.overlay =
      about.has("overlay") ? kOverlays[about.choice("overlay", {"cape", "blue", "none"})] : "cape";
  if (about.has("calibration")) board.calibration_file = about.text("calibration");
  about.finish();

  Section imu = root.table("imu");
  board.wiring.imu = read_imu(imu, &board.facts);

  Section bridges = root.table("bridges");
  board.wiring.pwm_hz = static_cast<std::uint32_t>(bridges.integer("pwm_hz", 100, 100000));
  const bool active_low = bridges.boolean("enable_active_low");
  board.wiring.enable = read_pin(bridges, "enable", active_low);
  board.facts.pwm_hz = board.wiring.pwm_hz;
  bridges.finish();

  for (Section& section : root.tables("motor", 1, RIO_MAX_MOTORS)) {
    const bbb_motor_t motor = read_motor(section);
    if (motor.bridge != (board.wiring.motors == 0 ? motor : board.wiring.motor[0]).bridge)
      section.fail("bridge", "differs from the first motor's; all bridges are of one type");
    board.wiring.motor[board.wiring.motors++] = motor;
  }
  board.facts.bridge = board.wiring.motor[0].bridge == BBB_MC33926 ? "drive_coast" : "drive_brake";
  read_battery(root.table("battery"), &board);
  read_panel(root, &board);
  root.finish();
  return board;
}

}  // namespace

Board load_wiring(const std::string& path) { return read_board(Document(path, {})); }

Board load_board(const std::string& path) {
  Board board = load_wiring(path);
  if (board.calibration_file.empty()) return board;
  const auto file = std::filesystem::path(path).parent_path() / board.calibration_file;
  const CalibrationFile calibration = load_calibration(file.string(), board.robot);
  board.measured = measured_of(calibration, board.facts.R_BS);
  return board;
}

Overrides overrides_of(const Board& board, std::vector<std::string> set) {
  Overrides overrides(std::move(set));
  overrides.board = board.facts;
  overrides.measured = board.measured;
  return overrides;
}

std::string missing_calibration(const Board& board) {
  std::string missing;
  if (!board.measured.gyro_bias_B_rad_s) missing += "gyro";
  if (!board.measured.accel_bias_B_m_s2) missing += missing.empty() ? "accelerometer" : ", accelerometer";
  if (missing.empty()) return "";
  return missing + " not calibrated" +
         (board.calibration_file.empty() ? "; the board names no calibration file" : "");
}

Board parse_board(const std::string& text, const std::string& origin) {
  return read_board(Document::parse(text, origin));
}

}  // namespace equipoise::app
