// Reference vectors, derived independently of this project's code (tests/data/oracle).
#pragma once

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "equipoise/types.hpp"

namespace equipoise::test {

inline nlohmann::json oracle_rows(const std::string& name) {
  std::ifstream file(std::string(EQUIPOISE_SOURCE_DIR) + "/tests/data/oracle/" + name + ".json");
  return nlohmann::json::parse(file).at("rows");
}

template <int N>
Vec<N> vector_of(const nlohmann::json& row, const char* key) {
  Vec<N> v;
  for (int i = 0; i < N; ++i) v(i) = row.at(key).at(static_cast<std::size_t>(i)).get<double>();
  return v;
}

/// |a - b| relative to b, absolute below one.
inline double relative_error(double a, double b) { return std::abs(a - b) / std::max(1.0, std::abs(b)); }

template <class A, class B>
double relative_error(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  double worst = 0.0;
  for (Eigen::Index i = 0; i < a.size(); ++i) worst = std::max(worst, relative_error(a(i), b(i)));
  return worst;
}

}  // namespace equipoise::test
