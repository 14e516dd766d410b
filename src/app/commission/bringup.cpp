// The first hour of a new robot: is everything there, does it rest, is it wired as its board file says?
#include <cstdio>
#include <filesystem>
#include <memory>

#include "app/board/calibration_file.hpp"
#include "app/cli/commands.hpp"
#include "app/commission/board_edit.hpp"
#include "app/commission/calibrate_imu.hpp"
#include "app/commission/calibrate_wheels.hpp"
#include "app/commission/commissioning.hpp"
#include "app/doctor/doctor.hpp"
#include "app/text/files.hpp"
#include "app/text/json.hpp"

namespace equipoise::app {
namespace {

struct BringupArguments {
  CommissioningArguments commissioning;
  std::string out = "board.toml";
  bool force = false;
  std::string json;
};

void say(const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); }

void refuse_ill_machine(const Commissioning& commissioning, const std::string& board_path) {
  doctor::Patient patient;
  patient.board = &commissioning.board();
  patient.board_path = board_path;
  const doctor::Findings findings = doctor::examine(patient);
  for (const doctor::Finding& f : findings) {
    // Not looked at is as bad as bad: this machine is no robot.
    if (f.verdict == doctor::Verdict::kFail || (f.name == "board" && f.verdict == doctor::Verdict::kSkipped))
      throw JobError("doctor: " + f.name + ": " + f.what + "; " + f.fix);
  }
}

std::vector<WheelFinding> pulse_wheels(Commissioning& commissioning) {
  const auto manual = commissioning.open();
  manual->ask({Request::kUpright,
               "hang the robot up by its head or lay it on soft foam, wheels free; they will turn a little. "
               "Then press Enter"});
  std::vector<WheelFinding> findings =
      pulse_all(*manual, commissioning.layout(), commissioning.calibration());
  for (const WheelFinding& f : findings) say("  " + describe(f));
  return findings;
}

CalibrationFile measure_gyro(Commissioning& commissioning) {
  const auto manual = commissioning.open();
  manual->ask({Request::kUpright, "put the robot down, do not touch it, then press Enter"});
  const Stillness still = manual->hold_still(3.0);
  const GyroBias bias = gyro_bias(still, commissioning.calibration());
  CalibrationFile file;
  file.robot = commissioning.robot();
  file.wheel_count = commissioning.layout().wheels;
  file.gyro = {stamp_of(still.temperature_degC), bias.bias_S_rad_s, bias.sigma_S_rad_s};
  return file;
}

int run_bringup(const BringupArguments& a) {
  Commissioning commissioning(a.commissioning);
  const auto folder = std::filesystem::path(a.out).parent_path();
  const std::string calibration_name = std::filesystem::path(a.out).stem().string() + "-calibration.toml";
  const std::string calibration_path = (folder / calibration_name).string();
  for (const std::string& path : {a.out, calibration_path}) {
    if (std::filesystem::exists(path) && !a.force)
      throw InputError(path + ": exists; give another --out, or --force to replace it");
  }
  if (!commissioning.on_stand()) {
    say("1 of 4: the machine");
    refuse_ill_machine(commissioning, a.commissioning.board);
  }
  say("2 of 4: at rest");
  const CalibrationFile calibration = measure_gyro(commissioning);

  say("3 of 4: motors, encoders, wheels");
  const std::vector<WheelFinding> findings = pulse_wheels(commissioning);
  const std::string wrong = complaint(findings);
  const std::string text =
      with_calibration(rewired(read_text(a.commissioning.board), findings), calibration_name);
  const Board corrected = parse_board(text, a.out);
  if (!wrong.empty()) {
    say("  corrected: " + wrong + "; 4 of 4: again, with the corrected board file");
    commissioning.change_board(corrected);
    const std::string still_wrong = complaint(pulse_wheels(commissioning));
    if (!still_wrong.empty())
      throw JobError("after the correction: " + still_wrong + "; nothing was written");
  }
  write_whole(to_toml(calibration), calibration_path);
  write_whole(text, a.out);
  std::fprintf(
      a.json == "-" ? stderr : stdout,
      "%s\nwritten to %s and %s\nnext: equipoise calibrate accel --config %s --board %s --out %s%s\n",
      wrong.empty() ? "wired as the board file says" : ("corrected: " + wrong).c_str(), a.out.c_str(),
      calibration_path.c_str(), a.commissioning.config.c_str(), a.out.c_str(), calibration_path.c_str(),
      commissioning.on_stand() ? " --backend stand" : "");
  if (!a.json.empty())
    write_json({{"board", a.out}, {"calibration", calibration_path}, {"corrected", wrong}}, a.json);
  return 0;
}

}  // namespace

void add_bringup(Subcommand app) {
  const Subcommand command =
      app.subcommand("bringup", "Finds the wiring by short pulses on the stand, and writes a board file")
          .example(
              "equipoise bringup --config config/mbbr.toml --board config/boards/robotics_cape_mbbr.toml");
  auto a = std::make_shared<BringupArguments>();
  add_options(command, &a->commissioning);
  command.option("--out", a->out, "board file to write; its calibration goes beside it")
      .file()
      .show_default();
  command.flag("--force", a->force, "replace existing files");
  command.option("--json", a->json, "result as JSON, - for stdout").file();
  command.action([=] { return run_bringup(*a); });
}

}  // namespace equipoise::app
