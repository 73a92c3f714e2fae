#include "diagnose/stability.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/decompositions.hpp"
#include "diagnose/resampling.hpp"
#include "diagnose/signed_fit.hpp"

namespace diffnea {
namespace {

/// Pairs of halves: shares are then known to 0.07 (binomial).
constexpr int kPairs = 25;
/// Blocks below which a half is no sample of the motion.
constexpr std::size_t kFewestToHalve = 8;

/// Share of a contender's square that a half must have, to show it.
constexpr double kShown = 0.25;

/// Columns [basis of the base | contenders | residual], their products over a set of blocks.
struct Products {
  MatX<double> K;
  double rows = 0.0;
};

/// One contender's columns among those of all.
struct Slot {
  std::vector<int> linear;
  int offset = -1;
  std::vector<bool> signs;
  double parameters = 0.0, penalty = 0.0;
};

/// The base projected out of a half: products of contenders and residual.
class Half {
 public:
  Half(const Products& of, long base, const Search& search, const std::vector<Slot>& slots)
      : search_(search),
        slots_(slots),
        share_(of.rows / static_cast<double>(search.rows())),
        rows_(of.rows) {
    const long rest = of.K.cols() - base;
    MatX<double> B = of.K.topLeftCorner(base, base);
    B.diagonal().array() += 1e-10;  // columns have length 1 at most
    const MatX<double> cross = of.K.topRightCorner(base, rest);
    K_ = of.K.bottomRightCorner(rest, rest);
    if (base > 0) K_ -= cross.transpose() * B.ldlt().solve(cross);
  }

  /// BIC of contenders together.
  double bic(const std::vector<int>& chosen) const {
    std::vector<int> linear, offsets;
    std::vector<bool> signs;
    double parameters = 0.0, penalty = 0.0;
    for (const int c : chosen) {
      const Slot& p = slots_[c];
      linear.insert(linear.end(), p.linear.begin(), p.linear.end());
      signs.insert(signs.end(), p.signs.begin(), p.signs.end());
      if (p.offset >= 0) offsets.push_back(p.offset);
      parameters += p.parameters;
      penalty += p.penalty;
    }
    const int y = static_cast<int>(K_.cols()) - 1;
    VecX<double> b = K_(linear, y);
    double left = K_(y, y);
    for (const int o : offsets) {
      b -= K_(linear, o);
      left -= 2.0 * K_(o, y);
      for (const int other : offsets) left += K_(o, other);
    }
    left -= signed_fit(K_(linear, linear), b, signs).gain;
    return search_.cost(left, share_) + 0.5 * (parameters * std::log(rows_ / share_) + penalty);
  }

  /// Square of a contender's torque at these values.
  double square(const Slot& slot, const VecX<double>& values) const {
    double out = values.dot(K_(slot.linear, slot.linear) * values);
    if (slot.offset >= 0)
      out += 2.0 * values.dot(K_(slot.linear, slot.offset)) + K_(slot.offset, slot.offset);
    return std::max(out, 0.0);
  }

  /// Contenders that a selection chooses: forward by ΔBIC, and out again what it no longer needs.
  std::vector<int> select(double accept) const {
    std::vector<int> chosen;
    double now = bic(chosen);
    while (chosen.size() < slots_.size()) {
      int best = -1;
      double least = now - accept;
      for (int c = 0; c < static_cast<int>(slots_.size()); ++c) {
        if (std::ranges::find(chosen, c) != chosen.end()) continue;
        chosen.push_back(c);
        if (const double with = bic(chosen); with < least) least = with, best = c;
        chosen.pop_back();
      }
      if (best < 0) break;
      chosen.push_back(best);
      now = least;
      for (std::size_t i = 0; i + 1 < chosen.size();) {
        std::vector<int> rest = chosen;
        rest.erase(rest.begin() + static_cast<long>(i));
        if (const double alone = bic(rest); alone < now + accept) {
          chosen = rest;
          now = alone;
          i = 0;
        } else {
          ++i;
        }
      }
    }
    return chosen;
  }

 private:
  const Search& search_;
  const std::vector<Slot>& slots_;
  double share_, rows_;
  MatX<double> K_;
};

/// Instants of each block.
std::vector<std::vector<long>> blocks_of(const Evidence& evidence, double seconds) {
  const long length = std::max<long>(std::lround(seconds / evidence.step()), 1);
  std::vector<std::vector<long>> out;
  int stretch = -1;
  for (long i = 0; i < evidence.times(); ++i) {
    const int at = evidence.stretch()[i];
    if (out.empty() || at != stretch || std::ssize(out.back()) >= length) out.emplace_back();
    stretch = at;
    out.back().push_back(i);
  }
  return out;
}

}  // namespace

std::vector<HalfChoice> choose_on_halves(const Search& search, const std::vector<Term>& contenders,
                                         double accept, std::uint64_t seed) {
  const Evidence& evidence = search.evidence();
  const Projection& projection = search.projection();
  const long base = projection.rank(), m = evidence.times(), n = evidence.rows();
  std::vector<Slot> slots;
  long width = base;
  for (const Term& c : contenders) {
    Slot slot;
    for (long k = 0; k < c.width(); ++k) slot.linear.push_back(static_cast<int>(width - base + k));
    width += c.width();
    if (c.has_offset()) slot.offset = static_cast<int>(width++ - base);
    slot.signs = signs(c.effect, c.linear);
    slot.parameters = c.num_parameters();
    slot.penalty = search.looked_elsewhere(c.candidate);
    slots.push_back(std::move(slot));
  }
  MatX<double> all(projection.residual().size(), width + 1);
  all.leftCols(base) = projection.basis();
  long at = base;
  for (const Term& c : contenders) {
    const MatX<double> columns = projection.expanded(c.beside);
    all.middleCols(at, columns.cols()) = columns;
    at += columns.cols();
  }
  all.col(width) = projection.residual();

  const std::vector<bool>& kept = search.whitener().kept();
  const auto products = [&](const std::vector<long>& instants) {
    std::vector<long> rows;
    for (long k = 0; k < n / m; ++k)
      for (const long i : instants)
        if (kept[k * m + i]) rows.push_back(k * m + i);
    const MatX<double> of = all(rows, Eigen::all);
    return Products{of.transpose() * of, static_cast<double>(rows.size())};
  };
  std::vector<Products> blocks;
  for (double seconds = kBlockSeconds; blocks.size() < kFewestToHalve; seconds *= 0.5) {
    if (seconds < 0.25 * kBlockSeconds) return {};
    blocks.clear();
    for (const std::vector<long>& instants : blocks_of(evidence, seconds))
      if (Products of = products(instants); of.rows > 0.0) blocks.push_back(std::move(of));
  }
  const MatX<double> prior =
      all.bottomRows(all.rows() - n).transpose() * all.bottomRows(all.rows() - n);

  Rng rng(seed + 0x57ab);
  std::vector<std::size_t> order(blocks.size());
  std::iota(order.begin(), order.end(), 0);
  std::vector<HalfChoice> out;
  for (int pair = 0; pair < kPairs; ++pair) {
    shuffle(order, rng);
    for (int half = 0; half < 2; ++half) {
      Products sum{prior, 0.0};
      for (std::size_t i = static_cast<std::size_t>(half); i < order.size(); i += 2) {
        sum.K += blocks[order[i]].K;
        sum.rows += blocks[order[i]].rows;
      }
      const Half of(sum, base, search, slots);
      out.push_back({of.select(0.5 * accept), {}});
      for (std::size_t c = 0; c < contenders.size(); ++c)
        out.back().square.push_back(of.square(slots[c], contenders[c].values()));
    }
  }
  return out;
}

double share_of(const std::vector<HalfChoice>& halves, int contender, const std::vector<int>& any) {
  double shown = 0.0, chosen = 0.0;
  const std::size_t c = static_cast<std::size_t>(contender);
  for (std::size_t h = 0; h < halves.size(); ++h) {
    const double own = halves[h].square[c], other = halves[h ^ 1].square[c];
    if (!(own > kShown * (own + other))) continue;
    shown += 1.0;
    chosen += std::ranges::any_of(halves[h].chosen,
                                  [&](int k) { return std::ranges::find(any, k) != any.end(); });
  }
  return shown > 0.0 ? chosen / shown : 0.0;
}

}  // namespace diffnea
