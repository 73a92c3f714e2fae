#include "diagnose/sessions.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "diagnose/resampling.hpp"

namespace diffnea {
namespace {

/// A block's mean and how many rows it is of.
struct Block {
  int run = 0;
  double sum = 0.0, rows = 0.0;
};

/// Sum of squares of the runs' means about the mean of all, by the run of each block.
double between(const std::vector<Block>& blocks, const std::vector<std::size_t>& order) {
  std::map<int, Block> runs;
  Block all;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const Block& drawn = blocks[order[b]];
    for (Block* of : {&runs[blocks[b].run], &all}) of->sum += drawn.sum, of->rows += drawn.rows;
  }
  double out = -all.sum * all.sum / all.rows;
  for (const auto& [run, of] : runs) out += of.sum * of.sum / of.rows;
  return out;
}

}  // namespace

bool tells_sessions(const Evidence& e) {
  std::map<int, double> seconds;
  return std::ranges::any_of(e.series(), [&](const JointSeries& s) {
    return (seconds[s.run] += static_cast<double>(s.rows()) * s.dt) > kBlockSeconds;
  });
}

double sessions_alike(const Evidence& e, const VecX<double>& errors, const std::vector<bool>& used,
                      long joint, std::uint64_t seed) {
  const long m = e.times(), length = std::max<long>(std::lround(kBlockSeconds / e.step()), 1);
  std::vector<Block> blocks;
  long rows = 0;
  int stretch = -1;
  for (long i = 0; i < m; ++i) {
    const int at = e.stretch()[i];
    if (at != stretch || rows == length) {
      blocks.push_back({e.series()[at].run, 0.0, 0.0});
      rows = 0;
      stretch = at;
    }
    ++rows;
    if (!used[joint * m + i]) continue;
    blocks.back().sum += errors[joint * m + i];
    blocks.back().rows += 1.0;
  }
  std::erase_if(blocks, [](const Block& b) { return b.rows == 0.0; });
  std::vector<std::size_t> order(blocks.size());
  std::iota(order.begin(), order.end(), 0);
  const double seen = between(blocks, order);
  Rng rng(seed + 0x5e55);
  int as_much = 0;
  for (int i = 0; i < kResamples; ++i) {
    shuffle(order, rng);
    as_much += between(blocks, order) >= seen * (1.0 - 1e-9);
  }
  return static_cast<double>(as_much) / kResamples;
}

}  // namespace diffnea
