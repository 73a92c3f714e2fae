#include "diagnose/cause_sizes.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "diagnose/inexact.hpp"
#include "diagnose/thresholds.hpp"

namespace diffnea {
namespace {

/// Of a parameter, beside what noise leaves: as well as filters and the reference model let an
/// effect's column be known, and its angle. The positions' noise shrinks it: 8 % observed.
constexpr double kColumnError = 0.04, kAngleError = 0.01;

/// Eigenvalue of columns of length 1, below which no row tells of their combination.
constexpr double kUntold = 1e-6;

/// Information on a shape beforehand: its logarithm is known to 1, as of the base's friction. One that no
/// row tells must not make a size look like none: of a gear that never brakes, the losses when it
/// brakes.
double shape_information(const ParameterInfo& p) { return scale(p) == Scale::kLog ? 1.0 : 0.0; }

/// Parameters at their bounds that no row tells, or only with others: a half of an asymmetric
/// friction beside the base's, which has what both have in common.
/// @param K  (parameters, parameters) products of columns of length 1; of length 0 if untold alone
std::vector<long> held_at_bounds(const MatX<double>& K, const std::vector<bool>& at_bound) {
  std::vector<long> out;
  if (std::ranges::none_of(at_bound, std::identity())) return out;
  const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(K);
  for (long k = 0; k < K.cols(); ++k)
    for (long e = 0; e < K.cols(); ++e)
      if (at_bound[k] && eigen.eigenvalues()[e] < kUntold &&
          std::abs(eigen.eigenvectors()(k, e)) > 0.1) {
        out.push_back(k);
        break;
      }
  return out;
}

/// Variances where rows are no independent ones but go with the motion, by blocks of time, the
/// same of every period together (Liang and Zeger 1986, eq. 6).
/// @param influence  (parameters, rows) of each row of `left` on each parameter
VecX<double> clustered(const Search& search, const MatX<double>& influence,
                       const VecX<double>& left) {
  const long m = search.evidence().times();
  std::map<long, VecX<double>> clusters;
  for (long i = 0; i < m; ++i) {
    double t = search.evidence().time()[i];
    if (search.period() > 0.0) t = std::fmod(t, search.period());
    VecX<double>& sum = clusters
                            .try_emplace(std::lround(std::floor(t / kBlockSeconds)),
                                         VecX<double>::Zero(influence.rows()))
                            .first->second;
    for (long row = i; row < search.evidence().rows(); row += m)
      sum += influence.col(row) * left[row];
  }
  VecX<double> out = VecX<double>::Zero(influence.rows());
  for (const auto& [cluster, sum] : clusters) out += sum.cwiseAbs2();
  const double count = static_cast<double>(clusters.size());
  return out * (count / std::max(count - 1.0, 1.0));
}

/// value ± std; no less than 0 where the sign is known.
void set_interval(CauseParameter& p, double std, bool nonnegative = false) {
  p.std = std;
  p.low = p.value - kNormal95 * std;
  p.high = p.value + kNormal95 * std;
  if (nonnegative && p.value >= 0.0) p.low = std::max(p.low, 0.0);
}

/// value · exp(± std of the logarithm)
void set_log_interval(CauseParameter& p, double log_std, double most) {
  p.std = std::abs(p.value) * log_std;
  const double reach = std::exp(std::min(kNormal95 * log_std, 20.0));
  p.low = std::min(p.value / reach, p.value * reach);
  p.high = std::min(std::max(p.value / reach, p.value * reach), most);
}

}  // namespace

std::vector<MatX<double>> covariances(const Search& search, const std::vector<Term>& terms) {
  std::vector<Beside> columns;
  std::vector<bool> at_bound;
  long width = 0;
  for (const Term& t : terms) {
    MatX<double> J(search.evidence().rows(), t.width() + std::ssize(t.shapes));
    J << t.columns, search.evidence().columns(t.effect, t.shapes);
    const std::vector<bool> nonnegative = signs(t.effect, t.linear);
    for (long k = 0; k < t.width(); ++k) {
      at_bound.push_back(nonnegative[k] && t.values()[k] == 0.0);
      if (at_bound.back() && !t.told(k)) J.col(k).setZero();
    }
    at_bound.resize(at_bound.size() + t.shapes.size(), false);
    width += J.cols();
    columns.push_back(search.projection().beside(J));
  }
  MatX<double> K(width, width);
  for (long row = 0; const Beside& a : columns) {
    for (long column = 0; const Beside& b : columns) {
      K.block(row, column, a.cols(), b.cols()) = product(a, b);
      column += b.cols();
    }
    row += a.cols();
  }
  for (long at = 0; const Term& t : terms) {
    at += t.width();
    for (const int k : t.shapes) K(at, at) += shape_information(t.effect.parameter_info[k]), ++at;
  }
  VecX<double> scale = K.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  K = scale.asDiagonal() * K * scale.asDiagonal();
  const std::vector<long> held = held_at_bounds(K, at_bound);
  for (const long k : held) {
    K.row(k).setZero();
    K.col(k).setZero();
    K(k, k) = 1.0;
  }
  K.diagonal().array() += 1e-9;
  MatX<double> C = K.llt().solve(MatX<double>::Identity(width, width));
  for (const long k : held) C(k, k) = 0.0;
  // Rows are in units of noise; a lack of fit that is left widens the intervals.
  const double chi2 = (search.residual_sum() - search.gain_of(terms)) /
                      static_cast<double>(std::max<long>(search.rows() - width, 1));
  C = scale.asDiagonal() * C * scale.asDiagonal();
  VecX<double> more = VecX<double>::Constant(width, std::max(1.0, chi2));
  if (chi2 > kLeft) {  // the rest goes with the motion
    MatX<double> J(search.projection().residual().size(), width);
    for (long at = 0; const Beside& c : columns) {
      J.middleCols(at, c.cols()) = search.projection().expanded(c);
      at += c.cols();
    }
    more = more.cwiseMax(clustered(search, C * J.transpose(), search.left_by(terms))
                             .cwiseQuotient(C.diagonal().cwiseMax(1e-300)));
  }
  more = more.cwiseSqrt();
  C = more.asDiagonal() * C * more.asDiagonal();
  std::vector<MatX<double>> out;
  long at = 0;
  for (const Beside& c : columns) {
    out.push_back(C.block(at, at, c.cols(), c.cols()));
    at += c.cols();
  }
  return out;
}

bool has_size(const Candidate& c, const Term& term) {
  if (term.effect.told >= 0)  // the gap; how its teeth bounce is no size
    return std::ranges::find(term.shapes, c.shapes.front()) != term.shapes.end();
  return c.rotor > 0.0 || term.shapes.size() >= c.shapes.size();
}

bool may_be_nothing(const Term& term, const std::vector<CauseParameter>& sizes) {
  // Its stiffness or gap is its size (has_size): neither its damping nor its rotor makes it none.
  if (term.effect.info().motor != HiddenMotor::kNone) return false;
  long told = 0, zero = 0;
  for (const int k : term.linear) {
    const CauseParameter& p = sizes[k];
    if (!std::isfinite(p.std)) continue;
    ++told;
    zero += p.low <= 0.0 && p.high >= 0.0;
  }
  return told > 0 && zero == told;
}

std::vector<CauseParameter> sizes(const Search& search, const std::vector<Term>& terms,
                                  std::size_t which, const MatX<double>& covariance) {
  const Term& t = terms[which];
  const Candidate& c = search.candidate(t);
  const bool shapes_show =
      t.effect.told >= 0 ? has_size(c, t) : t.shapes.size() >= c.shapes.size();
  // Where stiffness and rotor show as their ratio alone, they are as good as the declared rotor.
  const bool by_rotor = has_size(c, t) && !shapes_show;
  const double of_word = c.rotor > 0.0 && shapes_show ? 0.0 : c.held;
  const std::vector<bool> nonnegative = signs(t.effect, t.linear);
  const auto by_noise = [&](long at) { return std::sqrt(covariance(at, at)); };
  std::vector<CauseParameter> out;
  for (std::size_t k = 0; k < t.effect.parameter_info.size(); ++k) {
    const ParameterInfo& info = t.effect.parameter_info[k];
    CauseParameter p{info.name, info.unit, t.effect.parameters[k]};
    const auto linear = std::ranges::find(t.linear, static_cast<int>(k));
    const auto shape = std::ranges::find(t.shapes, static_cast<int>(k));
    if (linear != t.linear.end()) {
      const long at = linear - t.linear.begin();
      double std = std::hypot(by_noise(at), kColumnError * p.value);
      // It hangs on a shape that does not show; or the base hides it, as an offset a spring's rest.
      if ((!by_rotor && !shapes_show) || t.shares[at] < kAbsorbed) std = kNaN;
      set_interval(p, std, nonnegative[at]);
      // Whoever the rotor is, it does not make nothing of what is there.
      if (by_rotor && p.low > 0.0)
        set_log_interval(p, std::hypot(std / p.value, of_word), info.most);
      else if (by_rotor)
        set_interval(p, std::hypot(std, of_word * p.value), nonnegative[at]);
    } else if (t.effect.told >= 0 && scale(info) == Scale::kPlain) {
      p.std = kNaN;  // how teeth bounce makes up for flights that are told in part
    } else if (shape != t.shapes.end()) {
      const double noise = by_noise(t.width() + (shape - t.shapes.begin()));
      if (scale(info) == Scale::kPlain)
        set_interval(p, std::hypot(noise, kColumnError * p.value));
      else  // noise makes a ripple's column smaller, not its angles
        set_log_interval(p,
                         std::hypot(noise, info.name == "cycles" ? kAngleError : kColumnError, of_word),
                         info.most);
    } else if (by_rotor && info.name == "stiffness") {
      set_log_interval(p, std::hypot(kColumnError, of_word), info.most);
    }
    out.push_back(p);
  }
  return out;
}

std::vector<CauseParameter> of_robot(const Candidate& c, const Term& term,
                                     std::vector<CauseParameter> sizes) {
  if (term.effect.told >= 0) sizes.erase(sizes.begin() + term.effect.told);
  if (term.effect.own || !(c.swings > 0.0) || !encoder_at_motor(term.effect)) return sizes;
  const MotorSpring<double> spring = motor_spring(term.effect);
  const double ratio = 0.5 * spring.damping / std::sqrt(spring.stiffness * c.swings);
  for (CauseParameter& p : sizes) {
    if (!std::isfinite(p.std)) continue;
    if (p.name == "stiffness")
      set_log_interval(p, std::hypot(p.std / p.value, ratio), kInfinity);
    else if (p.name == "damping")
      p.low = 0.0;
  }
  return sizes;
}

}  // namespace diffnea
