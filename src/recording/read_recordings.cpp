/// Whole files: the blocks of a reader end to end, run for run, and several files as one.

#include <algorithm>

#include <diffnea/recording/csv.hpp>

namespace diffnea {
void ReadReport::add(const ReadReport& other) {
  source += (source.empty() ? "" : ", ") + other.source;
  rows += other.rows;
  quarantined += other.quarantined;
  quarantined_rows.insert(quarantined_rows.end(), other.quarantined_rows.begin(),
                          other.quarantined_rows.end());
  for (const std::string& name : other.extra_channels)
    if (std::ranges::find(extra_channels, name) == extra_channels.end())
      extra_channels.push_back(name);
  for (const std::string& note : other.notes) notes.push_back(other.source + ": " + note);
}

namespace {

/// Blocks of one run, end to end.
Recording concatenate(std::vector<Recording>& blocks) {
  if (blocks.size() == 1) return std::move(blocks.front());
  long rows = 0;
  for (const Recording& b : blocks) rows += b.rows();
  Recording out = blocks.front();
  const auto stack = [&](RowMatX<double> Recording::* member) {
    RowMatX<double>& m = out.*member;
    if (m.rows() == 0) return;  // not measured; without joints, q has rows and no columns
    m.resize(rows, m.cols());
    long at = 0;
    for (const Recording& b : blocks) {
      m.middleRows(at, b.rows()) = b.*member;
      at += b.rows();
    }
  };
  for (const auto member : kSeries) stack(member);
  out.time.resize(rows);
  for (ExtraChannel& e : out.extra) e.values.resize(rows);
  long at = 0;
  for (const Recording& b : blocks) {
    out.time.segment(at, b.rows()) = b.time;
    for (std::size_t i = 0; i < out.extra.size(); ++i)
      out.extra[i].values.segment(at, b.rows()) = b.extra[i].values;
    at += b.rows();
  }
  return out;
}

}  // namespace

std::vector<Recording> read_recordings(const std::filesystem::path& path,
                                       const ReadOptions& options, ReadReport* report) {
  constexpr long kBlockRows = 1 << 16;
  RecordingReader reader(path, options);
  std::vector<Recording> out, blocks;
  for (Recording block; reader.next(block, kBlockRows);) {
    if (!blocks.empty() && blocks.front().run != block.run) {
      out.push_back(concatenate(blocks));
      blocks.clear();
    }
    blocks.push_back(std::move(block));
  }
  if (!blocks.empty()) out.push_back(concatenate(blocks));
  if (report != nullptr) *report = reader.report();
  return out;
}

std::vector<Recording> read_recordings(const std::vector<std::filesystem::path>& paths,
                                       const ReadOptions& options, ReadReport* report) {
  std::vector<Recording> out;
  if (report != nullptr) *report = {};
  for (const std::filesystem::path& path : paths) {
    ReadReport one;
    for (Recording& r : read_recordings(path, options, &one)) {
      r.run = static_cast<int>(out.size());
      out.push_back(std::move(r));
    }
    if (report != nullptr) report->add(one);
  }
  return out;
}

}  // namespace diffnea
