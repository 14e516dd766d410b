// {"rows": [...]} in, {"rows": [...]} out: the shape of `model` and `bridge`.
#pragma once

#include <functional>
#include <string>

#include "app/cli/commands.hpp"
#include "app/text/json.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {

using Row = std::function<nlohmann::json(const nlohmann::json&)>;

/// The command applies a row's function to every row of --in; errors name the file, the row and the key.
/// `row`: makes it, when the command's options are known.
void add_rows(const Subcommand& command, const std::string& in_help, const std::function<Row()>& row);

double number_at(const nlohmann::json& row, const std::string& key);
/// False without it.
bool flag_at(const nlohmann::json& row, const std::string& key);
Eigen::VectorXd numbers_at(const nlohmann::json& row, const std::string& key, Eigen::Index count);

nlohmann::json array_of(const Eigen::VectorXd& v);

}  // namespace equipoise::app
