#pragma once
/// Recordings that a test writes down as text.

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <diffnea/recording/csv.hpp>

#include "support/temporary_folder.hpp"

namespace diffnea::test {

/// A file in a folder of its own.
struct CsvFile {
  TemporaryFolder folder;
  std::filesystem::path path = folder.path() / "arm.csv";

  explicit CsvFile(const std::string& text) { std::ofstream(path, std::ios::binary) << text; }
};

inline std::vector<Recording> read(const std::string& text, const ReadOptions& options = {},
                                   ReadReport* report = nullptr) {
  return read_recordings(CsvFile(text).path, options, report);
}

/// `rows` good rows of one joint, from row `first`.
inline std::string good_rows(int rows, int first = 0) {
  std::string out;
  for (int i = first; i < first + rows; ++i)
    out += std::to_string(0.01 * i) + "," + std::to_string(0.1 * i) + ",1.5\n";
  return out;
}

inline bool same(const RowMatX<double>& a, const RowMatX<double>& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return false;
  for (long i = 0; i < a.size(); ++i)
    if (!(a.data()[i] == b.data()[i] || (std::isnan(a.data()[i]) && std::isnan(b.data()[i]))))
      return false;
  return true;
}

/// 400 rows whose torque swings between ±2; the rows from `first` to before `end` have `absurd`.
inline std::string with_torques(const std::string& absurd, int first, int end) {
  std::string out = "time,q_a,tau_a\n";
  for (int i = 0; i < 400; ++i)
    out += std::to_string(0.01 * i) + ",0.1," +
           (i >= first && i < end ? absurd : std::to_string(2.0 * std::sin(0.1 * i))) + "\n";
  return out;
}

}  // namespace diffnea::test
