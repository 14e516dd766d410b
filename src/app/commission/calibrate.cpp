#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "app/board/calibration_file.hpp"
#include "app/cli/commands.hpp"
#include "app/commission/calibrate_imu.hpp"
#include "app/commission/calibrate_wheels.hpp"
#include "app/commission/commissioning.hpp"
#include "app/text/format.hpp"
#include "app/text/json.hpp"

namespace equipoise::app {
namespace {

constexpr double kGyro_s = 3.0;
constexpr double kPose_s = 1.0;
constexpr int kMaxPoses = 12;  // six faces and as many mistakes
constexpr int kTurns = 5;
constexpr double kMaxCountsError = 0.02;

struct CalibrateArguments {
  CommissioningArguments commissioning;
  std::string what;
  std::string out = "calibration.toml";
  std::string json;
};

struct Result {
  std::string text;
  std::string complaint;  // empty: all is as the files say
};

nlohmann::json json_of(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

Result calibrate_gyro(Commissioning& commissioning, CalibrationFile* file, nlohmann::json* json) {
  const auto manual = commissioning.open();
  const Stillness still = manual->hold_still(kGyro_s);
  const GyroBias found = gyro_bias(still, commissioning.calibration());
  file->gyro = {stamp_of(still.temperature_degC), found.bias_S_rad_s, found.sigma_S_rad_s};
  const Vec3 deg = found.bias_S_rad_s * 180.0 / kPi;
  *json = {{"bias_rad_s", json_of(found.bias_S_rad_s)}, {"sigma_rad_s", json_of(found.sigma_S_rad_s)}};
  return {format("gyro bias %.3f %.3f %.3f deg/s, noise %.3f deg/s", deg.x(), deg.y(), deg.z(),
                 found.sigma_S_rad_s.maxCoeff() * 180.0 / kPi),
          ""};
}

/// Specific force of a pose, nominal scale, sensor axes; JobError when the robot is not still.
Vec3 pose(ManualDrive& manual, const Calibration& c, double* temperature_degC) {
  const Stillness still = manual.hold_still(kPose_s);
  (void)gyro_bias(still, c);  // refuses motion
  *temperature_degC = still.temperature_degC;
  return c.accel_m_s2_per_count * still.accel;
}

Result calibrate_accel(Commissioning& commissioning, CalibrationFile* file, nlohmann::json* json) {
  const auto manual = commissioning.open();
  std::vector<Vec3> poses;
  std::array<bool, 6> seen{};
  double temperature = 0.0;
  for (int tries = 0; tries < kMaxPoses && poses.size() < seen.size(); ++tries) {
    int next = 0;
    while (seen[static_cast<std::size_t>(next)]) ++next;
    manual->ask({Request::kFaceUp,
                 std::string("put the robot down with the IMU's ") +
                     kFaceNames[static_cast<std::size_t>(next)] +
                     " side up (or any other side not seen yet), do not touch it, then press Enter",
                 next});
    const Vec3 accel = pose(*manual, commissioning.calibration(), &temperature);
    const int face = face_up(accel);
    if (face < 0 || seen[static_cast<std::size_t>(face)]) {
      std::fprintf(stderr, face < 0 ? "no face within 25 degrees of vertical; try again\n"
                                    : "that face was measured before; try another\n");
      continue;
    }
    seen[static_cast<std::size_t>(face)] = true;
    poses.push_back(accel);
    std::fprintf(stderr, "%s side: %.3f m/s2 (%zu of 6)\n", kFaceNames[static_cast<std::size_t>(face)],
                 accel.norm(), poses.size());
  }
  Vec3 check = Vec3::UnitX() * kGravity_m_s2;
  if (poses.size() == seen.size()) {
    manual->ask({Request::kTip, "prop the robot against something, on no side, then press Enter"});
    check = pose(*manual, commissioning.calibration(), &temperature);
  }
  const AccelFit fit = fit_six_faces(poses, check);
  file->accel = {stamp_of(temperature), fit.scale_S, fit.bias_S_m_s2, fit.check_error_m_s2};
  const double mg = 1000.0 * fit.check_error_m_s2 / kGravity_m_s2;
  *json = {{"scale", json_of(fit.scale_S)},
           {"bias_m_s2", json_of(fit.bias_S_m_s2)},
           {"check_error_mg", mg},
           {"quality", mg < 5.0    ? "good"
                       : mg < 15.0 ? "fair"
                                   : "poor"}};
  return {
      format(
          "accelerometer scale %.4f %.4f %.4f, bias %.3f %.3f %.3f m/s2; off by %.1f mg in a pose it was not "
          "fitted to",
          fit.scale_S.x(), fit.scale_S.y(), fit.scale_S.z(), fit.bias_S_m_s2.x(), fit.bias_S_m_s2.y(),
          fit.bias_S_m_s2.z(), mg),
      mg < 15.0 ? "" : "the fit is poor: repeat it on a firm table"};
}

Result calibrate_mount(Commissioning& commissioning, CalibrationFile* file, nlohmann::json* json) {
  const auto manual = commissioning.open();
  double temperature = 0.0;
  const auto corrected = [&](const Vec3& a) {
    return file->accel ? Vec3(file->accel->scale.cwiseProduct(a) - file->accel->bias_m_s2) : a;
  };
  manual->ask({Request::kUpright, "stand the robot exactly upright, do not touch it, then press Enter"});
  const Vec3 upright = corrected(pose(*manual, commissioning.calibration(), &temperature));
  manual->ask({Request::kTip, commissioning.tip_words() + ", prop it there, then press Enter"});
  const Vec3 tipped = corrected(pose(*manual, commissioning.calibration(), &temperature));
  const Mat3 R_BS = mount_rotation(upright, tipped, commissioning.setup().tip_axis_B);
  file->mount = {stamp_of(temperature), R_BS};
  const double off =
      std::acos(std::clamp(0.5 * ((R_BS * commissioning.calibration().R_BS.transpose()).trace() - 1.0), -1.0,
                           1.0)) *
      180.0 / kPi;
  nlohmann::json rows = nlohmann::json::array();
  for (int i = 0; i < 9; ++i) rows.push_back(R_BS(i / 3, i % 3));
  *json = {{"R_BS", rows}, {"degrees_from_board_file", off}};
  return {format("the IMU sits %.1f degrees from where the board file says", off), ""};
}

Result calibrate_motors(Commissioning& commissioning, CalibrationFile* file, nlohmann::json* json) {
  const auto manual = commissioning.open();
  const double temperature = manual->hold_still(0.1).temperature_degC;
  const std::vector<WheelFinding> findings =
      pulse_all(*manual, commissioning.layout(), commissioning.calibration());
  Result result;
  CalibrationFile::Motors motors{stamp_of(temperature), {}, {}, {}};
  (*json)["motors"] = nlohmann::json::array();
  for (const WheelFinding& f : findings) {
    motors.wheel_of_motor.push_back(*f.wheel + 1);
    motors.encoder_of_motor.push_back(f.encoder + 1);
    motors.drive.push_back(f.drive);
    result.text += (result.text.empty() ? "" : "\n") + describe(f);
    (*json)["motors"].push_back({{"wheel", *f.wheel + 1},
                                 {"encoder", f.encoder + 1},
                                 {"drive", f.drive},
                                 {"turns_backwards", *f.turns_backwards},
                                 {"counts_down", f.counts_down},
                                 {"kick_sigmas", f.kick_sigmas}});
  }
  file->motors = motors;
  result.complaint = complaint(findings);
  if (!result.complaint.empty()) result.complaint += "; equipoise bringup writes a board file that fits";
  return result;
}

Result calibrate_encoders(Commissioning& commissioning, CalibrationFile* file, nlohmann::json* json) {
  const auto manual = commissioning.open();
  CalibrationFile::Encoders encoders{stamp_of(manual->hold_still(0.1).temperature_degC), {}};
  Result result;
  for (int wheel = 0; wheel < commissioning.layout().wheels; ++wheel) {
    const EncoderFinding found = turn_by_hand(*manual, commissioning.layout(), wheel, kTurns);
    const double expected = commissioning.layout().counts_per_rev;
    encoders.counts_per_rev.push_back(found.counts_per_rev);
    result.text += (wheel == 0 ? "" : "\n") + format("wheel %d: encoder %d, %.1f counts per turn", wheel + 1,
                                                     found.encoder + 1, found.counts_per_rev);
    const auto add = [&](const std::string& line) {
      result.complaint += (result.complaint.empty() ? "" : "; ") + line;
    };
    if (found.encoder != wheel)
      add(format("wheel %d is counted by encoder %d", wheel + 1, found.encoder + 1));
    if (found.counts_per_rev < 0.0) add(format("encoder %d counts backwards", found.encoder + 1));
    if (std::abs(std::abs(found.counts_per_rev) - expected) > kMaxCountsError * expected) {
      add(format("wheel %d has %.1f counts per turn where calibration.encoder_counts_per_rev says %.1f",
                 wheel + 1, std::abs(found.counts_per_rev), expected));
    }
  }
  (*json)["counts_per_rev"] = encoders.counts_per_rev;
  file->encoders = encoders;
  return result;
}

int run_calibrate(const CalibrateArguments& a) {
  Commissioning commissioning(a.commissioning);
  CalibrationFile file;
  if (std::filesystem::exists(a.out)) file = load_calibration(a.out, commissioning.robot());
  file.robot = commissioning.robot();
  file.wheel_count = commissioning.layout().wheels;
  nlohmann::json json;
  const Result result = a.what == "gyro"     ? calibrate_gyro(commissioning, &file, &json)
                        : a.what == "accel"  ? calibrate_accel(commissioning, &file, &json)
                        : a.what == "mount"  ? calibrate_mount(commissioning, &file, &json)
                        : a.what == "motors" ? calibrate_motors(commissioning, &file, &json)
                                             : calibrate_encoders(commissioning, &file, &json);
  const bool rejected = a.what == "accel" && !result.complaint.empty();  // others measure what is there
  if (!rejected) write_whole(to_toml(file), a.out);
  std::FILE* const out = a.json == "-" ? stderr : stdout;
  std::fprintf(out, "%s\n%s %s\n", result.text.c_str(), rejected ? "not written to" : "written to",
               a.out.c_str());
  json["what"] = a.what;
  json["file"] = a.out;
  json["complaint"] = result.complaint.empty() ? nlohmann::json(nullptr) : nlohmann::json(result.complaint);
  if (!a.json.empty()) write_json(json, a.json);
  if (result.complaint.empty()) return 0;
  std::fprintf(stderr, "equipoise: %s\n", result.complaint.c_str());
  return 1;
}

}  // namespace

void add_calibrate(Subcommand app) {
  const Subcommand command =
      app.subcommand("calibrate", "Measures a robot at rest or on its stand; keeps the result")
          .example("equipoise calibrate gyro --config config/mbbr.toml --board board.toml");
  auto a = std::make_shared<CalibrateArguments>();
  command
      .option("what", a->what,
              "gyro: bias, 3 s at rest; accel: bias and scale, six sides up; mount: how the board sits; "
              "motors: which wheel each turns and which way; encoders: counts per turn, by hand")
      .required()
      .one_of({"gyro", "accel", "mount", "motors", "encoders"});
  add_options(command, &a->commissioning);
  command.option("--out", a->out, "calibration file to add to").file().show_default();
  command.option("--json", a->json, "result as JSON, - for stdout").file();
  command.action([=] { return run_calibrate(*a); });
}

}  // namespace equipoise::app
