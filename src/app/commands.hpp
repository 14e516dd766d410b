// The subcommands. Each file in src/app adds one; `status` becomes the exit code.
#pragma once

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace equipoise::app {

/// Bad usage or input: exit code 2.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

void add_commands(CLI::App& app, int* status);

void add_sim(CLI::App& app, int* status);
void add_run(CLI::App& app, int* status);
void add_convert(CLI::App& app, int* status);
void add_keygen(CLI::App& app, int* status);
void add_send(CLI::App& app, int* status);
void add_replay(CLI::App& app, int* status);
void add_model(CLI::App& app, int* status);
void add_bridge(CLI::App& app, int* status);
void add_geometry(CLI::App& app, int* status);
void add_attitude(CLI::App& app, int* status);
void add_motor_bench(CLI::App& app, int* status);
void add_friction_rig(CLI::App& app, int* status);
void add_identify(CLI::App& app, int* status);
void add_bench(CLI::App& app, int* status);
void add_campaign(CLI::App& app, int* status);
void add_guard(CLI::App& app, int* status);
void add_doctor(CLI::App& app, int* status);
void add_calibrate(CLI::App& app, int* status);
void add_bringup(CLI::App& app, int* status);

/// A whole file; InputError names it.
std::string read_text(const std::string& path);
/// Reads a JSON file; InputError names it.
nlohmann::json read_json(const std::string& path);
/// Writes to a file, or to stdout where `path` is "-".
void write_json(const nlohmann::json& value, const std::string& path);

}  // namespace equipoise::app
