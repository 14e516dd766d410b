#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "app/cli/commands.hpp"
#include "app/doctor/doctor.hpp"
#include "app/text/json.hpp"
#include "app/text/version.hpp"

namespace equipoise::app {
namespace {

nlohmann::json to_json(const doctor::Patient& patient, const doctor::Findings& findings) {
  nlohmann::json checks = nlohmann::json::array();
  for (const doctor::Finding& f : findings) {
    checks.push_back(
        {{"name", f.name}, {"verdict", doctor::name_of(f.verdict)}, {"what", f.what}, {"fix", f.fix}});
  }
  return {{"ok", doctor::healthy(findings)},
          {"board", patient.board == nullptr ? nlohmann::json(nullptr) : nlohmann::json(patient.board_path)},
          {"checks", checks},
          {"version", version()}};
}

void print(const doctor::Findings& findings, std::FILE* out) {
  std::array<int, 4> count{};
  for (const doctor::Finding& f : findings) {
    ++count[static_cast<std::size_t>(f.verdict)];
    std::fprintf(out, "%-8s %-20s %s\n", doctor::name_of(f.verdict), f.name.c_str(), f.what.c_str());
    if (!f.fix.empty()) std::fprintf(out, "%-8s %-20s   -> %s\n", "", "", f.fix.c_str());
  }
  std::fprintf(out, "%d ok, %d warnings, %d failures, %d skipped\n", count[0], count[1], count[2], count[3]);
}

struct Arguments {
  std::string board;
  std::string key;
  std::string json;
  std::string report;
  std::string root;
};

int run_doctor(const Arguments& a) {
  doctor::Patient patient;
  Board board;
  if (!a.board.empty()) {
    board = load_board(a.board);
    patient.board = &board;
    patient.board_path = a.board;
  }
  if (!a.root.empty()) {
    if (!std::filesystem::is_directory(a.root)) throw InputError("--root " + a.root + ": no such directory");
    patient.root = std::filesystem::canonical(a.root).string();
  }
  patient.key = a.key;
  const doctor::Findings findings = doctor::examine(patient);
  print(findings, a.json == "-" ? stderr : stdout);
  if (!a.json.empty()) write_json(to_json(patient, findings), a.json);
  if (!a.report.empty()) {
    doctor::write_report(patient, findings, a.report);
    std::fprintf(stderr, "written to %s: send this with your question\n", a.report.c_str());
  }
  return doctor::healthy(findings) ? 0 : 1;
}

}  // namespace

void add_doctor(Subcommand app) {
  const Subcommand command =
      app.subcommand("doctor", "Checks whether this machine can run a robot, and suggests fixes")
          .example("equipoise doctor --board board.toml");
  auto a = std::make_shared<Arguments>();
  command.option("--board", a->board, "wiring, TOML: also look at everything it names").file();
  command.option("--command-key", a->key, "also look at this key file of run and send").file();
  command.option("--json", a->json, "findings as JSON, - for stdout").file();
  command.option("--report", a->report, "everything a helper needs, as text, into this file").file();
  command.option("--root", a->root, "look at /sys, /proc and /dev below this directory, e.g. of a test")
      .file();
  command.action([=] { return run_doctor(*a); });
}

}  // namespace equipoise::app
