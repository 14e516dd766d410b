#include "app/board/calibration_file.hpp"

#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>

#include "app/cli/commands.hpp"
#include "app/text/files.hpp"
#include "config/toml_reader.hpp"

namespace equipoise::app {
namespace {

using config::Document;
using config::Section;

constexpr int kVersion = 1;
using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

CalibrationFile::Stamp read_stamp(Section& s) {
  CalibrationFile::Stamp stamp;
  stamp.date = s.text("date");
  if (s.has("temperature_degC")) stamp.temperature_degC = s.number("temperature_degC", -60.0, 150.0);
  return stamp;
}

std::vector<int> read_indices(Section& s, const std::string& key, std::size_t count) {
  std::vector<int> indices;
  for (const double value : s.numbers(key, count, 1.0, static_cast<double>(count)))
    indices.push_back(static_cast<int>(value));
  return indices;
}

CalibrationFile read(const Document& document) {
  Section root(document, document.root(), "");
  CalibrationFile file;
  const int version = root.integer("version", 1, 1000000);
  if (version != kVersion)
    root.fail("version", std::to_string(version) + " is not known to this build; allowed: " +
                             std::to_string(kVersion) + "; run equipoise calibrate again");
  file.robot = root.text("robot");
  file.wheel_count = root.integer("wheels", 1, 4);
  const auto wheels = static_cast<std::size_t>(file.wheel_count);
  if (root.has("gyro")) {
    Section s = root.table("gyro");
    file.gyro = {read_stamp(s), s.vector<3>("bias_rad_s", -1.0, 1.0), s.vector<3>("sigma_rad_s", 0.0, 1.0)};
    s.finish();
  }
  if (root.has("accel")) {
    Section s = root.table("accel");
    file.accel = {read_stamp(s), s.vector<3>("scale", 0.8, 1.2), s.vector<3>("bias_m_s2", -2.0, 2.0),
                  s.number("check_error_m_s2", 0.0, 10.0)};
    s.finish();
  }
  if (root.has("mount")) {
    Section s = root.table("mount");
    const CalibrationFile::Stamp stamp = read_stamp(s);
    file.mount = {stamp, s.rotation("R_BS")};
    s.finish();
  }
  if (root.has("motors")) {
    Section s = root.table("motors");
    file.motors = {read_stamp(s), read_indices(s, "wheel_of_motor", wheels),
                   read_indices(s, "encoder_of_motor", wheels), s.numbers("drive", wheels, 0.0, 1.0)};
    s.finish();
  }
  if (root.has("encoders")) {
    Section s = root.table("encoders");
    file.encoders = {read_stamp(s), s.numbers("counts_per_rev", wheels, -1e6, 1e6)};
    s.finish();
  }
  root.finish();
  return file;
}

/// Round trip exact; a TOML float needs a point or an exponent.
std::string toml_number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  return std::strpbrk(text, ".en") != nullptr ? text : std::string(text) + ".0";
}

std::string toml_array(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "[" : ", ") + toml_number(value);
  return text + "]";
}

std::string toml_array(const Vec3& v) { return toml_array(std::vector<double>(v.data(), v.data() + 3)); }

std::string text_of(const CalibrationFile::Stamp& stamp) {
  std::string text = "date = \"" + stamp.date + "\"\n";
  if (stamp.temperature_degC) text += "temperature_degC = " + toml_number(*stamp.temperature_degC) + "\n";
  return text;
}

std::string indices_of(const std::vector<int>& values) {
  std::string text;
  for (const int value : values) text += (text.empty() ? "[" : ", ") + std::to_string(value);
  return text + "]";
}

}  // namespace

CalibrationFile::Stamp stamp_of(double temperature_degC) {
  CalibrationFile::Stamp stamp;
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32];
  (void)std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  stamp.date = text;
  if (temperature_degC != 0.0) stamp.temperature_degC = temperature_degC;
  return stamp;
}

CalibrationFile parse_calibration(const std::string& text, const std::string& origin) {
  return read(Document::parse(text, origin));
}

CalibrationFile load_calibration(const std::string& path, const std::string& robot) {
  if (!std::filesystem::exists(path))
    throw ConfigError(
        path + ": named by the board file but missing; make it with equipoise calibrate gyro --out " + path);
  CalibrationFile file = parse_calibration(read_text(path), path);
  if (file.robot != robot)
    throw ConfigError(path + ": robot: \"" + file.robot + "\" where the board file says \"" + robot + "\"");
  return file;
}

std::string to_toml(const CalibrationFile& file) {
  std::string text =
      "# Made by equipoise calibrate; axes of the sensor, SI units. A board file names it: [board] "
      "calibration.\n";
  text += "version = " + std::to_string(kVersion) + "\nrobot = \"" + file.robot +
          "\"\nwheels = " + std::to_string(file.wheel_count) + "\n";
  if (file.gyro) {
    text += "\n[gyro]\n" + text_of(file.gyro->stamp) + "bias_rad_s = " + toml_array(file.gyro->bias_rad_s) +
            "\nsigma_rad_s = " + toml_array(file.gyro->sigma_rad_s) + "\n";
  }
  if (file.accel) {
    text += "\n[accel]\n" + text_of(file.accel->stamp) + "scale = " + toml_array(file.accel->scale) +
            "\nbias_m_s2 = " + toml_array(file.accel->bias_m_s2) +
            "\ncheck_error_m_s2 = " + toml_number(file.accel->check_error_m_s2) + "\n";
  }
  if (file.mount) {
    const RowMajor rows = file.mount->R_BS;
    text += "\n[mount]\n" + text_of(file.mount->stamp) +
            "R_BS = " + toml_array(std::vector<double>(rows.data(), rows.data() + rows.size())) + "\n";
  }
  if (file.motors) {
    text += "\n[motors]\n" + text_of(file.motors->stamp) +
            "wheel_of_motor = " + indices_of(file.motors->wheel_of_motor) +
            "\nencoder_of_motor = " + indices_of(file.motors->encoder_of_motor) +
            "\ndrive = " + toml_array(file.motors->drive) + "\n";
  }
  if (file.encoders) {
    text += "\n[encoders]\n" + text_of(file.encoders->stamp) +
            "counts_per_rev = " + toml_array(file.encoders->counts_per_rev) + "\n";
  }
  return text;
}

/// The file itself, not a link to it; beside it under a name that no other file has.
void write_whole(const std::string& text, const std::string& path) {
  std::error_code error;
  const std::filesystem::path linked = std::filesystem::canonical(path, error);
  const std::string target = error ? path : linked.string();
  const std::string partial = target + "." + std::to_string(getpid()) + ".partial";
  std::ofstream file(partial);
  const bool written = file << text && file.flush();
  file.close();
  if (written) std::filesystem::rename(partial, target, error);
  if (written && !error) return;
  std::error_code ignored;
  std::filesystem::remove(partial, ignored);
  throw InputError(path + ": " + (written ? error.message() : "cannot be written"));
}

void save_calibration(const CalibrationFile& file, const std::string& path) {
  write_whole(to_toml(file), path);
}

MeasuredCalibration measured_of(const CalibrationFile& file, const std::array<double, 9>& board_R_BS) {
  const Mat3 board = Eigen::Map<const RowMajor>(board_R_BS.data());
  const Mat3 R_BS = file.mount ? file.mount->R_BS : board;
  const auto array = [](const Vec3& v) { return std::array<double, 3>{v.x(), v.y(), v.z()}; };
  MeasuredCalibration measured;
  if (file.mount) {
    measured.R_BS.emplace();
    Eigen::Map<RowMajor>(measured.R_BS->data()) = R_BS;
  }
  if (file.gyro) measured.gyro_bias_B_rad_s = array(R_BS * file.gyro->bias_rad_s);
  if (file.accel) {
    measured.accel_scale_S = array(file.accel->scale);
    measured.accel_bias_B_m_s2 = array(R_BS * file.accel->bias_m_s2);
  }
  return measured;
}

}  // namespace equipoise::app
