// Piecewise linear interpolation over the magnitude of the yaw rate, held beyond the ends: no jumps.
// In: |yaw rate| -> out: the interpolated row. RT-safe: fixed size, bounded search.
#pragma once

#include <array>
#include <cstddef>

namespace equipoise {

template <std::size_t Columns, std::size_t MaxRows = 16>
struct GainSchedule {
  std::array<double, MaxRows> at{};  // ascending
  std::array<std::array<double, Columns>, MaxRows> row{};
  std::size_t rows = 0;

  std::array<double, Columns> operator()(double x) const noexcept {
    std::size_t i = 0;
    while (i + 2 < rows && x >= at[i + 1]) ++i;
    if (rows < 2) return row[0];
    double f = (x - at[i]) / (at[i + 1] - at[i]);
    f = f < 0.0 ? 0.0 : (f > 1.0 ? 1.0 : f);
    std::array<double, Columns> out{};
    for (std::size_t c = 0; c < Columns; ++c) out[c] = row[i][c] + f * (row[i + 1][c] - row[i][c]);
    return out;
  }
};

}  // namespace equipoise
