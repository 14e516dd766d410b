// "Did you mean": of known names the one that a wrong one is nearest to. Start-up only.
#pragma once

#include <string>
#include <vector>

namespace equipoise::config {

/// Empty when none is near.
std::string nearest(const std::string& wrong, const std::vector<std::string>& known);

/// "; did you mean X?", or nothing.
std::string did_you_mean(const std::string& wrong, const std::vector<std::string>& known);

}  // namespace equipoise::config
