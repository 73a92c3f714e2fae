#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/policy/ereps.hpp>

#include "core/c_numbers.hpp"
#include "core/constants.hpp"
#include "core/decompositions.hpp"

namespace diffnea {
namespace {

/// Rewards that are not −∞, and where they stand. @throws DataError as reweight()
struct FiniteRewards {
  VecX<double> values;
  std::vector<long> index;
};
FiniteRewards finite_rewards(const char* where, const VecX<double>& rewards) {
  FiniteRewards out;
  for (long i = 0; i < rewards.size(); ++i) {
    if (std::isnan(rewards[i]) || rewards[i] == kInfinity)
      throw DataError(std::string(where) + ": reward " + std::to_string(i) + " is " +
                      (std::isnan(rewards[i]) ? "NaN" : "+inf") +
                      ", expected a finite one or -inf (never again)");
    if (std::isfinite(rewards[i])) out.index.push_back(i);
  }
  if (out.index.empty())
    throw DataError(std::string(where) + ": none of " + std::to_string(rewards.size()) +
                    " rewards is finite");
  out.values = rewards(out.index);
  return out;
}

/// What exp(a/η) makes of M samples, a ≤ 0 = max a.
struct Tempered {
  double log_mean;     ///< log(1/M Σ exp(a/η))
  VecX<double> ratio;  ///< of weights to uniform ones
  double kl;           ///< of the weights against uniform ones
};
Tempered temper(const VecX<double>& a, double eta) {
  const VecX<double> exponent = a / eta;
  const double less = exponent.array().unaryExpr([](double x) { return std::expm1(x); }).mean();
  Tempered out{less > -0.5 ? std::log1p(less) : std::log(exponent.array().exp().mean()),
               VecX<double>(a.size()), 0.0};
  // 1/M Σ (x log x − x + 1): no summand is negative, so that a small bound is met exactly, too.
  for (long i = 0; i < a.size(); ++i) {
    const double log_ratio = exponent[i] - out.log_mean;
    out.ratio[i] = std::exp(log_ratio);
    out.kl += out.ratio[i] > 0.0 ? out.ratio[i] * log_ratio - std::expm1(log_ratio) : 1.0;
  }
  out.kl /= static_cast<double>(a.size());
  return out;
}

/// η/spread at the dual's minimum: g' = ε − KL(η), and KL falls from log(M/ties) to 0 as η grows.
/// @param a  rewards less the largest, in units of their spread: from −1 to 0
double solve_dual(const VecX<double>& a, double epsilon) {
  double gap = 1.0;  // from the best to the next
  for (const double x : a)
    if (x < 0.0) gap = std::min(gap, -x);
  // From exp(−700) at the second best, which is nothing, to KL ≤ mean|a|/η ≤ 1/η.
  double low = std::log(std::max(gap / 700.0, std::numeric_limits<double>::min()));
  if (temper(a, std::exp(low)).kl <= epsilon) return std::exp(low);
  double high = -std::log(epsilon);
  constexpr double kResolution = 1e-14;  // of log η; bisected to the last digits
  while (high - low > kResolution * std::max(1.0, std::abs(high))) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (temper(a, std::exp(middle)).kl <= epsilon ? high : low) = middle;
  }
  return std::exp(high);
}

std::string numbers(const VecX<double>& x) {
  std::string out;
  char text[32];
  for (const double v : x) {
    detail::print(text, sizeof text, "%.6g", v);
    out += (out.empty() ? "" : ", ") + std::string(text);
  }
  return out;
}

/// Every eigenvalue at least `least`.
MatX<double> floored(const MatX<double>& covariance, double least) {
  const MatX<double> rest =
      covariance - least * MatX<double>::Identity(covariance.rows(), covariance.cols());
  if (Eigen::LLT<MatX<double>>(rest).info() == Eigen::Success) return covariance;
  const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(covariance);
  const MatX<double> root =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(least).cwiseSqrt().asDiagonal();
  return root * root.transpose();
}

void require_ereps(bool ok, const std::string& what) {
  if (!ok) throw Error("Ereps: " + what);
}

void require_gaussian(const Gaussian& g) {
  if (g.size() < 1 || g.covariance.rows() != g.size() || g.covariance.cols() != g.size())
    throw ShapeError("Ereps: a mean of " + std::to_string(g.size()) + " and a covariance of " +
                     std::to_string(g.covariance.rows()) + " x " +
                     std::to_string(g.covariance.cols()) + " make no Gaussian");
  require_ereps(g.mean.allFinite() && g.covariance.allFinite(), "the Gaussian is not finite");
  require_ereps(std::isfinite(kl_divergence(g, g)), "the covariance is not positive definite");
}

}  // namespace

double ereps_dual(const VecX<double>& rewards, double epsilon, double eta, double* slope) {
  const VecX<double> R = finite_rewards("ereps_dual", rewards).values;
  if (!(eta > 0.0)) throw Error("ereps_dual: eta must be positive");
  const double best = R.maxCoeff();
  const Tempered t = temper(R.array() - best, eta);
  if (slope) *slope = epsilon - t.kl;
  return eta * epsilon + best + eta * t.log_mean;
}

Reweighting reweight(const VecX<double>& rewards, double epsilon) {
  if (!(epsilon > 0.0)) throw Error("reweight: epsilon must be positive");
  const FiniteRewards finite = finite_rewards("reweight", rewards);
  const VecX<double> half = 0.5 * finite.values;  // whose spread never overflows
  const double best = half.maxCoeff(), spread = best - half.minCoeff();

  Reweighting out;
  VecX<double> a = VecX<double>::Zero(half.size());
  double eta = 1.0;
  if (spread > 0.0) {
    a = (half.array() - best) / spread;
    eta = solve_dual(a, epsilon);
    out.eta = std::min(2.0 * (eta * spread), std::numeric_limits<double>::max());
  } else {
    out.eta = std::max(1.0, std::abs(finite.values[0]));  // any does: weights are uniform
  }
  const Tempered t = temper(a, eta);
  out.kl = t.kl;
  out.weights = VecX<double>::Zero(rewards.size());
  const double sum = t.ratio.sum();
  for (std::size_t i = 0; i < finite.index.size(); ++i)
    out.weights[finite.index[i]] = t.ratio[static_cast<long>(i)] / sum;
  out.effective_samples = 1.0 / out.weights.squaredNorm();
  return out;
}

Gaussian bounded_update(const Gaussian& old, const RowMatX<double>& theta,
                        const VecX<double>& weights, double kappa, double least_std, double* kl) {
  require_gaussian(old);
  require_size("bounded_update", theta.cols(), old.size(), "parameter");
  require_size("bounded_update", weights.size(), theta.rows(), "sample");
  constexpr double kSumTol = 1e-9;  // rounding of 10⁶ weights, with margin
  require_ereps(weights.minCoeff() >= 0.0 && std::abs(weights.sum() - 1.0) < kSumTol,
                "weights must not be negative, and their sum must be 1");
  require_ereps(kappa > 0.0, "kappa must be positive");

  const VecX<double> likely = theta.transpose() * weights;
  const RowMatX<double> centred = theta.rowwise() - likely.transpose();
  const MatX<double> scatter = centred.transpose() * weights.asDiagonal() * centred;
  const VecX<double> shift = likely - old.mean;
  // What is below the floor before stays: raising it could break the bound at every λ.
  const double least = std::min(least_std * least_std, Eigen::SelfAdjointEigenSolver<MatX<double>>(
                                                           old.covariance, Eigen::EigenvaluesOnly)
                                                           .eigenvalues()
                                                           .minCoeff());

  // With a = 1/(1 + λ): μ' = μ + a δ, Σ' = a S + (1 − a) Σ + a (1 − a) δδᵀ, where δ and S are mean
  // (from the old one) and covariance of the weighted samples.
  const auto update = [&](double lambda) {
    const double a = 1.0 / (1.0 + lambda), b = lambda / (1.0 + lambda);
    MatX<double> covariance = a * scatter + b * old.covariance + a * b * shift * shift.transpose();
    covariance = floored(covariance, least);
    return Gaussian{old.mean + a * shift, 0.5 * (covariance + covariance.transpose())};
  };
  Gaussian out = update(0.0);
  double reached = kl_divergence(old, out);
  if (!(reached <= kappa)) {
    // Never feasible at `low`, always at `high` where `out` was made.
    double low = -30.0, high = low;  // log λ
    constexpr double kLast = 700.0;  // where out = old
    for (double stride = 30.0; !(reached <= kappa) && high < kLast; stride *= 2.0) {
      low = high;
      high = std::min(high + stride, kLast);
      out = update(std::exp(high));
      reached = kl_divergence(old, out);
    }
    if (!(reached <= kappa)) {
      out = old;
      reached = 0.0;
    }
    constexpr double kResolution = 1e-12;  // of log λ, and so of the bound
    while (high - low > kResolution * std::max(1.0, std::abs(high))) {
      const double middle = 0.5 * (low + high);
      Gaussian candidate = update(std::exp(middle));
      const double divergence = kl_divergence(old, candidate);
      if (!(divergence <= kappa)) {
        low = middle;
        continue;
      }
      high = middle;
      out = std::move(candidate);
      reached = divergence;
    }
  }
  if (kl) *kl = reached;
  return out;
}

Ereps::Ereps(Gaussian start, const ErepsOptions& options, std::uint64_t seed)
    : policy_(std::move(start)), options_(options), seed_(seed) {
  require_ereps(options.samples >= 2,
                std::to_string(options.samples) + " samples an iteration, expected at least 2");
  require_ereps(options.iterations >= 1, "iterations must be at least 1");
  require_ereps(options.epsilon > 0.0 && options.kappa > 0.0, "epsilon and kappa must be positive");
  require_ereps(options.stop_std >= 0.0 && options.least_std >= 0.0,
                "stop_std and least_std must not be negative");
  require_gaussian(policy_);
  judge();
}

const RowMatX<double>& Ereps::ask() {
  if (sampled_for_ == iteration()) return samples_;
  // Seeds one apart give streams that share nothing; the first number hides that users count, too.
  Rng rng(Rng(seed_).next() + static_cast<std::uint64_t>(iteration()));
  samples_ = policy_.sample(options_.samples, rng);
  sampled_for_ = iteration();
  return samples_;
}

void Ereps::tell(const VecX<double>& rewards) {
  ask();
  require_size("Ereps::tell", rewards.size(), options_.samples, "sample");
  const std::string where = "Ereps: iteration " + std::to_string(iteration() + 1);
  for (long i = 0; i < rewards.size(); ++i)
    if (std::isnan(rewards[i]) || rewards[i] == kInfinity)
      throw DataError(
          where + ", sample " + std::to_string(i) + ": its reward is " +
          (std::isnan(rewards[i]) ? "NaN" : "+inf") +
          ", expected a finite one or -inf; parameters: " + numbers(samples_.row(i).transpose()));
  if (!(rewards.array() > -kInfinity).any())
    throw DataError(where + ": all " + std::to_string(rewards.size()) +
                    " rewards are -inf, nothing can be learned from them");

  const Reweighting weighted = reweight(rewards, options_.epsilon);
  ErepsIteration done;
  Gaussian next = bounded_update(policy_, samples_, weighted.weights, options_.kappa,
                                 options_.least_std, &done.kl_update);
  long first = 0;
  const double largest = rewards.maxCoeff(&first);
  const double before = history_.empty() ? -kInfinity : history_.back().reward_best;
  const Eigen::Array<bool, Eigen::Dynamic, 1> finite = rewards.array() > -kInfinity;
  done.iteration = iteration() + 1;
  done.reward_mean =
      finite.select(rewards.array() / static_cast<double>(finite.count()), 0.0).sum();
  done.reward_best = std::max(before, largest);
  done.eta = weighted.eta;
  done.kl_samples = weighted.kl;
  done.entropy = next.entropy();
  done.effective_samples = weighted.effective_samples;
  done.largest_std = next.std().maxCoeff();

  history_.push_back(done);
  if (largest > before) best_ = samples_.row(first).transpose();
  policy_ = std::move(next);
  judge();
}

void Ereps::judge() {
  stopped_.clear();
  char text[80];
  if (policy_.std().maxCoeff() < options_.stop_std) {
    detail::print(text, sizeof text, "every standard deviation is below %.3g", options_.stop_std);
    stopped_ = text;
  } else if (iteration() >= options_.iterations) {
    stopped_ = std::to_string(iteration()) + " iterations are done";
  }
}

bool Ereps::done() const { return !stopped_.empty(); }

const std::string& Ereps::stop_reason() const { return stopped_; }

void Ereps::restore(Gaussian policy, VecX<double> best, std::vector<ErepsIteration> history) {
  require_gaussian(policy);
  require_size("Ereps::restore", policy.size(), policy_.size(), "parameter");
  require_size("Ereps::restore: best", best.size(), history.empty() ? 0 : policy_.size(),
               "parameter");
  for (std::size_t i = 0; i < history.size(); ++i)
    require_ereps(history[i].iteration == static_cast<int>(i) + 1,
                  "row " + std::to_string(i) + " of the history is of iteration " +
                      std::to_string(history[i].iteration));
  policy_ = std::move(policy);
  best_ = std::move(best);
  history_ = std::move(history);
  sampled_for_ = -1;
  judge();
}

}  // namespace diffnea
