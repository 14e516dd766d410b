// {"rows": [...]} in, {"rows": [...]} out: the shape of `model` and `bridge`.
#pragma once

#include <functional>

#include "app/cli/commands.hpp"
#include "app/text/json.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {

/// Applies `row` to every row of the file; errors name the file, the row and the key.
nlohmann::json map_rows(const std::string& path,
                        const std::function<nlohmann::json(const nlohmann::json&)>& row);

double number_at(const nlohmann::json& row, const std::string& key);
Eigen::VectorXd numbers_at(const nlohmann::json& row, const std::string& key, Eigen::Index count);

nlohmann::json array_of(const Eigen::VectorXd& v);

}  // namespace equipoise::app
