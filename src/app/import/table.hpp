// A table of numbers as other tools write it: CSV, columns by blanks, rows of float32. In: path, shape ->
// out: named columns; InputError names the file, the line and what is wrong. A missing cell is NaN; text is
// refused only in a column that somebody asks for. Not RT-safe.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace equipoise::app {

struct TableShape {
  std::vector<std::string> columns;  // empty: as the table's first line says
  bool float32 = false;              // little-endian rows without separators; else text
  int header_bytes = 0;              // of float32, before the first row
};

struct Table {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;
  std::map<std::string, std::string> text;  // by column, the first cell that is no number: where and what
  std::size_t torn_rows = 0;                // with another number of cells than columns, not used

  std::size_t rows() const { return columns.empty() ? 0 : columns.front().size(); }
  const std::vector<double>& column(const std::string& name) const;
};

Table read_table(const std::string& path, const TableShape& shape);

}  // namespace equipoise::app
