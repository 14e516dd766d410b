#include "app/board/calibration_file.hpp"

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "app/text/errors.hpp"
#include "app/text/files.hpp"
#include "app/text/json.hpp"
#include "config/toml_reader.hpp"
#include "equipoise/runtime/log_parts.hpp"

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

CalibrationFile read_document(const Document& document) {
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

/// Numbers, texts and arrays of them are the same in TOML as in JSON; numbers come back exactly.
std::string line(const char* key, const nlohmann::json& value) {
  return std::string(key) + " = " + value.dump() + "\n";
}

std::string head(const char* table, const CalibrationFile::Stamp& stamp) {
  return "\n[" + std::string(table) + "]\n" + line("date", stamp.date) +
         (stamp.temperature_degC ? line("temperature_degC", *stamp.temperature_degC) : "");
}

}  // namespace

CalibrationFile::Stamp stamp_of(double temperature_degC) {
  CalibrationFile::Stamp stamp;
  stamp.date = runtime::utc_text(std::time(nullptr), "%Y-%m-%dT%H:%M:%SZ");
  if (temperature_degC != 0.0) stamp.temperature_degC = temperature_degC;
  return stamp;
}

CalibrationFile parse_calibration(const std::string& text, const std::string& origin) {
  return read_document(Document::parse(text, origin));
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
  const auto list = [](const auto& m) { return std::vector<double>(m.data(), m.data() + m.size()); };
  std::string text =
      "# Made by equipoise calibrate; axes of the sensor, SI units. A board file names it: [board] "
      "calibration.\n";
  text += line("version", kVersion) + line("robot", file.robot) + line("wheels", file.wheel_count);
  if (const auto& gyro = file.gyro) {
    text += head("gyro", gyro->stamp) + line("bias_rad_s", list(gyro->bias_rad_s)) +
            line("sigma_rad_s", list(gyro->sigma_rad_s));
  }
  if (const auto& accel = file.accel) {
    text += head("accel", accel->stamp) + line("scale", list(accel->scale)) +
            line("bias_m_s2", list(accel->bias_m_s2)) + line("check_error_m_s2", accel->check_error_m_s2);
  }
  if (file.mount) text += head("mount", file.mount->stamp) + line("R_BS", list(RowMajor(file.mount->R_BS)));
  if (const auto& motors = file.motors) {
    text += head("motors", motors->stamp) + line("wheel_of_motor", motors->wheel_of_motor) +
            line("encoder_of_motor", motors->encoder_of_motor) + line("drive", motors->drive);
  }
  if (file.encoders)
    text += head("encoders", file.encoders->stamp) + line("counts_per_rev", file.encoders->counts_per_rev);
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
