#include "diagnose/held_out.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include <diffnea/core/error.hpp>

#include "diagnose/resampling.hpp"
#include "identify/passes.hpp"
#include "recording/overlap.hpp"

namespace diffnea {
namespace {

/// Length of a block, shorter than kBlockSeconds where there would be fewer than kBlocks.
constexpr double kShortestBlockSeconds = 0.5;
constexpr long kBlocks = 8;
/// Rows of a run that are worth their seconds in a message: an acceleration takes three.
constexpr int kLeastRows = 4;

/// Standard errors of an offset that is beyond doubt; of the error's mean square, to be worth a
/// word.
constexpr double kDoubtless = 5.0, kWorthAWord = 0.25;

/// Instants of the shortest block: longer than the noise remembers.
long shortest_block(const Evidence& evidence) {
  return std::max<long>(std::lround(kShortestBlockSeconds / evidence.step()), kNoiseOrder);
}

[[noreturn]] void refuse_short(double seconds, double least, const std::vector<Recording>& sample) {
  const std::string lost = detail::uneven_columns(sample);
  throw DataError(sample.front().source + ": diagnose: " + format_number(seconds) +
                  " s of held-out rows" +
                  (lost.empty() ? "" : " in which every column has a value (" + lost + ")") +
                  " cannot tell whether a cause helps; expected " + format_number(least) +
                  " s or more: record longer");
}

long block_of(const Evidence& evidence, long instants) {
  const long second = std::lround(kBlockSeconds / evidence.step());
  return std::max(std::min(second, instants / kBlocks), shortest_block(evidence));
}

/// χ² by which a parameter that is fitted to the held-out rows themselves flatters them (Akaike
/// 1974).
constexpr double kOfParameter = 2.0;

/// Takes of errors what each block has of a gap's flights, from none to all; each block pays.
/// @param flights  (rows()) whole, in the units of out.left
void take_flights(const Evidence& e, const VecX<double>& flights, Prediction& out) {
  const long m = e.times(), block = block_of(e, m);
  for (long first = 0, end = 0; first < m; first = end) {
    const auto stretch = [&](long i) { return e.stretch()[i]; };
    while (end < m && end < first + block && stretch(end) == stretch(first)) ++end;
    double square = 0.0, product = 0.0;
    for (long row = first; row < out.left.size(); row += m) {
      square += flights.segment(row, end - first).squaredNorm();
      product += flights.segment(row, end - first).dot(out.left.segment(row, end - first));
    }
    if (square < kOfParameter) continue;  // nothing flies
    const double share = std::clamp(product / square, 0.0, 1.0);
    for (long row = first; row < out.left.size(); row += m)
      out.left.segment(row, end - first) -= share * flights.segment(row, end - first);
    out.moved += kOfParameter;
  }
}

}  // namespace

void require_blocks(const std::vector<Recording>& sample) {
  double seconds = 0.0;
  long longest = 0;
  for (const Recording& r : sample) {
    if (r.rows() > 1) seconds += r.time[r.rows() - 1] - r.time[0];
    longest = std::max(longest, r.rows());
  }
  if (longest < kLeastRows)
    throw DataError(sample.front().source + ": diagnose: held-out data: " +
                    detail::why_no_rows(sample, kLeastRows));
  const double least = static_cast<double>(kFewestBlocks) * kShortestBlockSeconds;
  if (seconds < least) refuse_short(seconds, least, sample);
}

void require_blocks(const Evidence& test, const std::vector<Recording>& sample) {
  const long least = static_cast<long>(kFewestBlocks) * shortest_block(test);
  if (test.times() < least)
    refuse_short(static_cast<double>(test.times()) * test.step(),
                 static_cast<double>(least) * test.step(), sample);
}

VecX<double> HeldOut::errors(const Search& search, const std::vector<Term>& terms) const {
  return errors_with(search, terms, VecX<double>::Zero(std::ssize(search.whitener().kept())),
                     VecX<double>::Zero(evidence_.rows()));
}

void HeldOut::take_means(int joint, VecX<double>& errors) const {
  const long m = evidence_.times();
  const long k = evidence_.index_of(joint);
  if (k < 0) return;
  const MatX<double> one = evidence_.rows_of(
      k, [](const JointSeries& s) { return RowMatX<double>::Ones(s.rows(), 1).eval(); });
  const auto run_of = [&](long i) { return evidence_.series()[evidence_.stretch()[i]].run; };
  std::map<int, std::pair<double, double>> runs;  // products with the error, and of itself
  for (long i = 0; i < m; ++i) {
    if (!used_.empty() && !used_[k * m + i]) continue;
    if (evidence_.rests(i, k)) continue;
    auto& [error, square] = runs[run_of(i)];
    error += one(i, 0) * errors[k * m + i];
    square += one(i, 0) * one(i, 0);
  }
  for (long i = 0; i < m; ++i)
    if (const auto [error, square] = runs[run_of(i)]; square > 0.0)
      errors[k * m + i] -= one(i, 0) * error / square;
}

VecX<double> HeldOut::errors_with(const Search& search, const std::vector<Term>& terms,
                                  VecX<double> there, VecX<double> here) const {
  for (const Term& t : terms) {
    there += t.torque();
    here += evidence_.torque_of(t.effect);
  }
  // The base that goes with them on the fitted rows.
  VecX<double> out =
      evidence_.torque() - here - evidence_.base() * search.projection().parameters(there);
  for (const Term& t : terms)
    if (is_of_runs(t.effect))
      for (const int joint : t.effect.joints) take_means(joint, out);
  return out;
}

const HeldOut::Known& HeldOut::known(const Search& search) const {
  if (known_.revision == search.revision()) return known_;
  const BasePrior& prior = search.projection().prior();
  known_.columns =
      whitener(search)(evidence_.without_scale(evidence_.base(), prior.x0, prior.free));
  known_.root = search.projection().root();
  MatX<double> both(known_.root.rows() + evidence_.rows(), known_.columns.cols());
  both << known_.root, known_.columns;
  known_.scale = both.colwise().norm().transpose();
  for (double& s : known_.scale) s = s > 0.0 ? 1.0 / s : 1.0;
  known_.both.setThreshold(kRankTolerance);
  known_.both.compute(both * known_.scale.asDiagonal());
  known_.revision = search.revision();
  return known_;
}

Prediction HeldOut::predicted(const Search& search, const std::vector<Term>& terms) const {
  Prediction out = predicted(search, errors(search, terms));
  for (const Term& t : terms) {
    if (t.effect.told < 0) continue;
    TriedEffect whole = t.effect;
    const double fitted = std::exchange(whole.parameters[t.effect.told], 1.0);
    const VecX<double> flights = predicted(search, evidence_.torque_of(whole)).left;
    out.left += fitted * flights;
    take_flights(evidence_, flights, out);
  }
  return out;
}

Prediction HeldOut::predicted(const Search& search, const VecX<double>& errors) const {
  Prediction out{whitener(search)(errors)};
  if (search.projection().prior().free.empty()) return out;
  const Known& k = known(search);
  VecX<double> y = VecX<double>::Zero(k.root.rows() + out.left.size());
  y.tail(out.left.size()) = out.left;
  const VecX<double> move = k.scale.cwiseProduct(k.both.solve(y));
  out.left -= k.columns * move;
  out.moved = (k.root * move).squaredNorm();
  return out;
}

std::vector<std::pair<std::size_t, double>> HeldOut::shares(const Search& search,
                                                            const std::vector<Term>& terms) const {
  const VecX<double> none = errors(search, {});
  VecX<double> left = predicted(search, none).left;
  const VecX<double> before = left;
  const auto relative = [&](VecX<double> error) {  // to that of its joint
    for (long k = 0, m = evidence_.times(); k * m < error.size(); ++k)
      error.segment(k * m, m) /= std::max(before.segment(k * m, m).norm(), 1e-300);
    return error;
  };
  left = relative(left);
  std::vector<VecX<double>> removes;  // the base is linear in what stands beside it
  VecX<double> after = left;
  for (const Term& t : terms) {
    removes.push_back(relative(predicted(search, none - errors(search, {t})).left));
    after -= removes.back();
  }
  const double all = left.squaredNorm() - after.squaredNorm();
  std::vector<std::pair<std::size_t, double>> out;
  std::vector<bool> taken(terms.size(), false);
  for (std::size_t step = 0; step < terms.size(); ++step) {
    const double now = left.squaredNorm();
    std::size_t best = terms.size();
    double least = 0.0;
    for (std::size_t i = 0; i < terms.size(); ++i) {
      if (taken[i]) continue;
      const double with = (left - removes[i]).squaredNorm();
      if (best == terms.size() || with < least) least = with, best = i;
    }
    taken[best] = true;
    left -= removes[best];
    out.emplace_back(best, all > 0.0 ? (now - least) / all
                                     : std::numeric_limits<double>::quiet_NaN());
  }
  return out;
}

std::vector<HeldOutOffset> HeldOut::offsets(const VecX<double>& errors) const {
  const long m = evidence_.times();
  const long block = std::max<long>(std::lround(kBlockSeconds / evidence_.step()), 8);
  std::vector<HeldOutOffset> out;
  for (std::size_t k = 0; k < evidence_.joints().size(); ++k) {
    std::vector<double> means;
    double sum = 0.0, square = 0.0, count = 0.0;
    for (long begin = 0; begin < m; begin += block) {
      double in_block = 0.0, n = 0.0;
      for (long i = begin; i < std::min(begin + block, m); ++i) {
        const long row = static_cast<long>(k) * m + i;
        if (!used_.empty() && !used_[row]) continue;
        if (evidence_.rests(i, k)) continue;
        in_block += errors[row];
        square += errors[row] * errors[row];
        n += 1.0;
      }
      if (n > 0.0) means.push_back(in_block / n);
      sum += in_block;
      count += n;
    }
    const double blocks = static_cast<double>(means.size());
    if (blocks < 8.0) continue;
    double scatter = 0.0;
    const double mean = sum / count;
    for (const double x : means) scatter += (x - mean) * (x - mean);
    const double std = std::sqrt(scatter / (blocks * (blocks - 1.0)));
    const double share = mean * mean * count / square;
    if (std::abs(mean) > kDoubtless * std && share > kWorthAWord)
      out.push_back({evidence_.joints()[k], mean, std, share});
  }
  return out;
}

HeldOutChange HeldOut::compare(const Prediction& without, const Prediction& with) const {
  const VecX<double>&before = without.left, &after = with.left;
  const long m = evidence_.times();
  long instants = 0;  // that count
  for (long i = 0; i < m; ++i) {
    bool any = false;
    for (long row = i; row < before.size(); row += m)
      any = any || before[row] != 0.0 || after[row] != 0.0;
    instants += any;
  }
  const long block = block_of(evidence_, instants);
  // Square of each block, part of it that is removed, and rows; then twice their log-likelihood.
  std::vector<std::array<double, 3>> of_blocks;
  for (long i = 0; i < m;) {
    double s = 0.0, d = 0.0;
    long count = 0, of_block = 0;
    const int stretch = evidence_.stretch()[i];
    for (; i < m && count < block && evidence_.stretch()[i] == stretch; ++i, ++count)
      for (long row = i; row < before.size(); row += m) {
        s += before[row] * before[row];
        d += before[row] * before[row] - after[row] * after[row];
        of_block += before[row] != 0.0 || after[row] != 0.0;
      }
    if (s != 0.0 || d != 0.0) of_blocks.push_back({s, d, static_cast<double>(of_block)});
  }
  const double blocks = static_cast<double>(of_blocks.size());
  for (auto& [square, removed, gained] : of_blocks) {
    square += without.moved / blocks;
    removed += (without.moved - with.moved) / blocks;
    gained *= -std::log(std::max(1.0 - removed / square, 1e-300));
  }
  HeldOutChange out;
  long rows = 0;
  for (long i = 0; i < before.size(); ++i) rows += before[i] != 0.0 || after[i] != 0.0;
  if (of_blocks.empty() || rows == 0) return out;
  out.before = (before.squaredNorm() + without.moved) / static_cast<double>(rows);
  out.after = (after.squaredNorm() + with.moved) / static_cast<double>(rows);
  std::vector<double> shares, logs;
  for (const auto& [square, removed, gained] : bootstrap(of_blocks, Rng(seed_ + 0x9e37))) {
    shares.push_back(removed / square);
    logs.push_back(gained);
  }
  out.log_low = interval(logs).first;
  std::tie(out.low, out.high) = interval(shares);
  if (of_blocks.size() < kFewestBlocks) {
    out.low = std::min(out.low, 0.0);
    out.log_low = std::min(out.log_low, 0.0);
    out.high = std::max(out.high, 0.0);
  }
  return out;
}

}  // namespace diffnea
