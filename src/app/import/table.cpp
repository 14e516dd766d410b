#include "app/import/table.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <initializer_list>
#include <limits>

#include "app/text/errors.hpp"
#include "app/text/files.hpp"
#include "app/text/format.hpp"

namespace equipoise::app {
namespace {

constexpr std::string_view kBlank = " \t\r\"";

/// Semicolon, tab or comma, the first of these that a line has, else runs of blanks; blanks around a cell do
/// not count.
void split(std::string_view line, std::vector<std::string_view>* cells) {
  cells->clear();
  constexpr std::string_view kSeparators = ";\t,";
  const auto* const found = std::find_if(kSeparators.begin(), kSeparators.end(),
                                         [line](char c) { return line.find(c) != std::string_view::npos; });
  const char separator = found == kSeparators.end() ? ' ' : *found;
  while (true) {
    const std::size_t begin = line.find_first_not_of(separator == '\t' ? " \r\"" : kBlank);
    line.remove_prefix(begin == std::string_view::npos ? line.size() : begin);
    if (separator == ' ' && line.empty()) return;
    const std::size_t end = line.find(separator);
    std::string_view cell = line.substr(0, end);
    cell = cell.substr(0, cell.find_last_not_of(kBlank) + 1);
    cells->push_back(cell);
    if (end == std::string_view::npos) return;
    line.remove_prefix(end + 1);
  }
}

/// NaN where the cell says so, is empty or is no number. A comma that separates no cells is a decimal one.
bool number(std::string_view cell, double* value) {
  *value = std::numeric_limits<double>::quiet_NaN();
  if (cell.empty() || cell == "nan" || cell == "NaN") return true;
  if (cell.front() == '+') cell.remove_prefix(1);
  std::string text(cell);
  std::replace(text.begin(), text.end(), ',', '.');
  double read = 0.0;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), read);
  const bool whole = end.ec == std::errc() && end.ptr == text.data() + text.size();
  if (whole) *value = read;
  return whole;
}

void start(std::vector<std::string> names, Table* table) {
  table->names = std::move(names);
  table->columns.resize(table->names.size());
}

Table read_text_table(const std::string& path, const TableShape& shape) {
  Table table;
  if (!shape.columns.empty()) start(shape.columns, &table);
  const std::string text = read_text(path);
  if (text.find('\0') != std::string::npos)
    throw InputError(path +
                     ": is no text; rows of float32 are read with table.format = \"float32\" in the map");
  std::vector<std::string_view> cells;
  std::vector<double> row;
  int number_of_line = 0;
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";  // which spreadsheets write
  for (std::size_t at = text.rfind(kByteOrderMark, 0) == 0 ? kByteOrderMark.size() : 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line(text.data() + at, end - at);
    at = end + 1;
    ++number_of_line;
    const std::size_t first = line.find_first_not_of(kBlank);
    if (first == std::string_view::npos || line[first] == '%' || line[first] == '#') continue;
    split(line, &cells);
    if (table.names.empty()) {
      start({cells.begin(), cells.end()}, &table);
      double value = 0.0;
      if (!number(cells.front(), &value)) continue;
      throw InputError(path + ":" + std::to_string(number_of_line) +
                       ": no line of column names; name them in the map: table.columns = [...]");
    }
    row.resize(cells.size());
    std::vector<std::size_t> text_cells;
    for (std::size_t i = 0; i < cells.size(); ++i)
      if (!number(cells[i], &row[i])) text_cells.push_back(i);
    const bool head = table.rows() == 0 && !text_cells.empty() &&
                      std::none_of(row.begin(), row.end(), [](double v) { return std::isfinite(v); });
    if (head) continue;  // of a table that the map names the columns of
    const bool ends_in_text = !text_cells.empty() && text_cells.back() + 1 == row.size();
    if (row.size() == table.names.size() + 1 && std::isnan(row.back()) && !ends_in_text)
      row.pop_back();  // "1,2,3,"
    if (row.size() != table.names.size()) {
      ++table.torn_rows;
      continue;
    }
    for (const std::size_t i : text_cells)
      table.text.emplace(table.names[i], path + ":" + std::to_string(number_of_line) + ": " + table.names[i] +
                                             ": \"" + std::string(cells[i]) + "\" is not a number");
    for (std::size_t i = 0; i < row.size(); ++i) table.columns[i].push_back(row[i]);
  }
  if (table.rows() == 0 && table.torn_rows > 0) {
    throw InputError(path + ": its rows have " + std::to_string(row.size()) + " cells, table.columns names " +
                     std::to_string(table.names.size()));
  }
  return table;
}

Table read_float32_table(const std::string& path, const TableShape& shape) {
  if (shape.columns.empty())
    throw InputError(path + ": table.columns is missing; float32 rows have no names");
  Table table;
  start(shape.columns, &table);
  const std::string bytes = read_text(path);
  const std::size_t width = 4 * table.names.size();
  const auto header = static_cast<std::size_t>(shape.header_bytes);
  const std::size_t rows = bytes.size() < header ? 0 : (bytes.size() - header) / width;
  if (rows > 0 && (bytes.size() - header) % width != 0) table.torn_rows = 1;
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    table.columns[i].resize(rows);
    for (std::size_t k = 0; k < rows; ++k) {
      std::uint32_t bits = 0;
      for (std::size_t b = 4; b > 0; --b)
        bits = bits << 8U | static_cast<unsigned char>(bytes[header + k * width + 4 * i + b - 1]);
      float value = 0.0F;
      std::memcpy(&value, &bits, sizeof value);
      table.columns[i][k] = static_cast<double>(value);
    }
  }
  return table;
}

}  // namespace

const std::vector<double>& Table::column(const std::string& name) const {
  const auto at = static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  if (at == names.size())
    throw InputError("the table has no column \"" + name + "\", which the map names; it has " +
                     joined(names));
  if (const auto wrong = text.find(name); wrong != text.end()) throw InputError(wrong->second);
  return columns[at];
}

Table read_table(const std::string& path, const TableShape& shape) {
  std::filesystem::path file(path);
  const std::initializer_list<const char*> others{".mat", ".parquet", ".feather", ".h5", ".xlsx"};
  if (std::any_of(others.begin(), others.end(), [&](const char* other) { return file.extension() == other; }))
    throw InputError(path + ": is no text; make a CSV of it: ./tools/table " + path + " > " +
                     file.replace_extension(".csv").string());
  return shape.float32 ? read_float32_table(path, shape) : read_text_table(path, shape);
}

}  // namespace equipoise::app
