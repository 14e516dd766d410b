#include "config/nearest.hpp"

#include <algorithm>

namespace equipoise::config {
namespace {

/// Letters to put in, take out or change.
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t next =
          std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      diagonal = row[j];
      row[j] = next;
    }
  }
  return row[b.size()];
}

}  // namespace

std::string nearest(const std::string& wrong, const std::vector<std::string>& known) {
  std::string found;
  std::size_t best = std::min<std::size_t>(3, wrong.size() / 2) + 1;
  for (const std::string& name : known) {
    const std::size_t d = distance(wrong, name);
    if (d < best) {
      best = d;
      found = name;
    }
  }
  return found;
}

std::string did_you_mean(const std::string& wrong, const std::vector<std::string>& known) {
  const std::string name = nearest(wrong, known);
  return name.empty() ? "" : "; did you mean " + name + "?";
}

}  // namespace equipoise::config
