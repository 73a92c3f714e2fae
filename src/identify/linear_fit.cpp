#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/model/physical.hpp>

namespace diffnea {
namespace {

/// Combinations with a smaller share of the largest pivot are structurally invisible: columns that
/// are exactly dependent leave 1e-13 (observed), directions that the data do see at all some 1e-5.
constexpr double kStructuralTol = 1e-9;

std::vector<int> free_columns(const FitLayout& layout) {
  std::vector<int> out;
  for (std::size_t i = 0; i < layout.linear.size(); ++i)
    if (!layout.linear[i].fixed) out.push_back(static_cast<int>(i));
  return out;
}

}  // namespace

namespace {

/// Root mean square of the torque that the links alone take at parameters x [N·m].
double link_torque(const FitLayout& layout, const JointFactor& f, const VecX<double>& x) {
  const MatX<double> R = f.factor.R();
  VecX<double> links = VecX<double>::Zero(R.cols());
  for (std::size_t k = 0; k < f.columns.size(); ++k)
    if (f.columns[k] < static_cast<int>(layout.linear.size()) &&
        layout.linear[f.columns[k]].dof >= 0)
      links[static_cast<long>(k)] = x[f.columns[k]];
  return (R * links).norm() / std::sqrt(static_cast<double>(std::max<long>(f.factor.rows(), 1)));
}

}  // namespace

VecX<double> parameter_scales(const FitLayout& layout, const std::vector<JointFactor>& factors) {
  VecX<double> scale(layout.linear.size());
  for (std::size_t i = 0; i < layout.linear.size(); ++i) scale[i] = layout.linear[i].scale;
  VecX<double> largest = VecX<double>::Zero(layout.linear.size());
  for (const JointFactor& f : factors) {
    if (f.factor.rows() == 0) continue;
    const MatX<double> R = f.factor.R();
    double torque = std::sqrt(f.factor.sum_of_squares(VecX<double>::Zero(R.cols())));
    if (torque == 0.0)  // a passive joint: what its links take
      torque =
          link_torque(layout, f, layout.prior()) * std::sqrt(static_cast<double>(f.factor.rows()));
    for (std::size_t k = 0; k < f.columns.size(); ++k) {
      const int c = f.columns[k];
      if (!std::isnan(layout.linear[c].scale)) continue;
      const double share = R.col(static_cast<long>(k)).norm() / std::max(torque, 1e-300);
      largest[c] = std::max(largest[c], share);
    }
  }
  for (long c = 0; c < scale.size(); ++c)
    if (std::isnan(scale[c]))
      scale[c] =
          std::max(std::abs(layout.linear[c].prior), largest[c] > 0 ? 1.0 / largest[c] : 1.0);
  return scale;
}

namespace {

/// The factors of all joints as one least-squares problem in units of their noise.
/// @param at  about which rows of passive joints are linear; null: as they are
void stack(const std::vector<JointFactor>& factors, const VecX<double>& sigma, long columns,
           MatX<double>& R, VecX<double>& d, const VecX<double>* at = nullptr) {
  TriangularFactor whole(static_cast<int>(columns));
  for (std::size_t j = 0; j < factors.size(); ++j) {
    const JointFactor& f = factors[j];
    if (f.factor.rows() == 0) continue;
    const bool passive = at && f.inertia.size() > 0;
    const TriangularFactor mapped =
        passive ? f.factor.mapped(f.without_scale(*at)) : TriangularFactor();
    const TriangularFactor& factor = passive ? mapped : f.factor;
    const MatX<double> Rj = factor.R();
    RowMatX<double> rows = RowMatX<double>::Zero(Rj.rows(), columns + 1);
    for (std::size_t k = 0; k < f.columns.size(); ++k)
      rows.col(f.columns[k]) = Rj.col(static_cast<long>(k)) / sigma[j];
    rows.col(columns) = factor.d() / sigma[j];
    whole.add(rows);
  }
  R = whole.R();
  d = whole.d();
}

}  // namespace

namespace {

/// A body of which some values are held and no body is known: those values, and a ball about its
/// center.
Theta<double> ball_with_held(const FitLayout& layout, int b, const Theta<double>& t, double m,
                             double I) {
  const auto held = [&](int k) { return layout.linear[b + k].fixed; };
  if (held(0)) m = t[0];
  Vec3<double> h{held(1) ? t[1] : 0.0, held(2) ? t[2] : 0.0, held(3) ? t[3] : 0.0};
  Theta<double> out =
      inertia_from_com<double>(m, h * (1.0 / std::max(m, 1e-300)), Sym3<double>{I, 0, 0, I, 0, I})
          .theta();
  for (int k = 0; k < kThetaSize; ++k)
    if (held(k)) out[k] = t[k];
  return out;
}

}  // namespace

VecX<double> consistent_start(const FitLayout& layout, const VecX<double>& scale) {
  VecX<double> x = layout.prior();
  for (const int b : layout.bodies()) {
    Theta<double> t;
    std::copy_n(x.data() + b, kThetaSize, t.begin());
    const double m = scale[b], I = scale[b + 4];
    const Theta<double> ball{m, 0, 0, 0, I, 0, 0, I, 0, I};
    // A thin or flat link lies on the boundary; a thousandth of the ball moves it inside.
    Theta<double> inner;
    const bool consistent = smallest_pseudo_inertia_eigenvalue(t) > -1e-12 * (t[0] + I) && t[0] > 0;
    for (int k = 0; k < kThetaSize; ++k) inner[k] = t[k] + 1e-3 * ball[k];
    if (!consistent) inner = ball_with_held(layout, b, t, m, I);
    const bool inside =
        consistent && smallest_pseudo_inertia_eigenvalue(t) > 1e-6 * (t[0] * I > 0 ? I : 1.0);
    std::ranges::copy(inside ? t : inner, x.data() + b);
  }
  for (std::size_t i = 0; i < layout.linear.size(); ++i)
    if (layout.linear[i].sign != Sign::kFree && !layout.linear[i].fixed)
      x[i] = std::max(x[i], 0.01 * scale[i]);
  return x;
}

namespace {

std::string number(double x) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.4g", std::abs(x));
  return buffer;
}

/// Base parameters by QR with column pivoting (Gautier 1991): x_i + Σ β x_d for each independent
/// column i, the dependent columns d regrouped into them. Columns compete in units of their scales;
/// what the links absorb is regrouped too, but never leads.
std::vector<BaseParameter> base_parameters(const FitLayout& layout, const MatX<double>& R,
                                           const VecX<double>& x, const VecX<double>& scale) {
  std::vector<int> columns;
  VecX<double> weight = scale;
  for (std::size_t k = 0; k < layout.linear.size(); ++k) {
    if (layout.linear[k].absorbed) weight[static_cast<long>(k)] *= 1e-4;
    if (!layout.linear[k].fixed || layout.linear[k].absorbed)
      columns.push_back(static_cast<int>(k));
  }
  MatX<double> Rs = R(Eigen::all, columns);
  for (long k = 0; k < Rs.cols(); ++k) Rs.col(k) *= weight[columns[static_cast<std::size_t>(k)]];
  Eigen::ColPivHouseholderQR<MatX<double>> qr(Rs);
  qr.setThreshold(kStructuralTol);
  const long rank = qr.rank(), p = Rs.cols();
  const MatX<double> upper = qr.matrixR().topRows(rank);
  const MatX<double> R1 = upper.leftCols(rank).template triangularView<Eigen::Upper>();
  MatX<double> beta(rank, p - rank);
  if (rank > 0 && p > rank) {
    const MatX<double> dependent = upper.rightCols(p - rank);
    beta = R1.template triangularView<Eigen::Upper>().solve(dependent);
  }
  std::vector<BaseParameter> out;
  const Eigen::VectorXi order = qr.colsPermutation().indices();
  for (long i = 0; i < rank; ++i) {
    const int lead = columns[static_cast<std::size_t>(order[i])];
    BaseParameter b;
    b.columns = {lead};
    b.coefficients = {1.0};
    b.expression = layout.linear[lead].name;
    b.value = x[lead];
    for (long k = 0; k < p - rank; ++k) {
      const int dependent = columns[static_cast<std::size_t>(order[rank + k])];
      const double c = beta(i, k) * weight[lead] / weight[dependent];
      // A share below a millionth of the scales is rounding.
      if (std::abs(c) * scale[dependent] < 1e-6 * scale[lead]) continue;
      b.columns.push_back(dependent);
      b.coefficients.push_back(c);
      b.expression += (c < 0 ? " - " : " + ") + number(c) + " " + layout.linear[dependent].name;
      b.value += c * x[dependent];
    }
    out.push_back(b);
  }
  std::ranges::sort(out, {}, [](const BaseParameter& b) { return b.columns.front(); });
  return out;
}

}  // namespace

namespace {

/// tr(H⁻¹ B) / f: how much larger the score's covariance is than independent residuals make it.
double mean_ratio(const MatX<double>& B, const MatX<double>& H) {
  const VecX<double> s = H.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  MatX<double> scaled = s.asDiagonal() * H * s.asDiagonal();
  scaled.diagonal().array() += 1e-8;  // dependent columns must not blow up
  const MatX<double> b = s.asDiagonal() * B * s.asDiagonal();
  return Eigen::LDLT<MatX<double>>(scaled).solve(b).trace() / static_cast<double>(B.rows());
}

}  // namespace

double JointFactor::sum_of_squares(const VecX<double>& x) const {
  return factor.sum_of_squares(x(columns));
}
MatX<double> JointFactor::without_scale(const VecX<double>& at) const {
  const long p = static_cast<long>(columns.size());
  MatX<double> T = MatX<double>::Identity(p + 1, p + 1);
  if (inertia.size() == 0) return T;
  const VecX<double> x = at(columns);
  const double m = inertia.dot(x);
  if (!(m > 0.0)) return T;
  T.topLeftCorner(p, p) -= x * (inertia.transpose() / m);
  T.col(p).head(p) = -x;
  return T;
}
double JointFactor::rmse(const VecX<double>& x) const {
  return std::sqrt(sum_of_squares(x) / static_cast<double>(std::max<long>(factor.rows(), 1)));
}

std::vector<int> absorbed_by_links(const FitLayout& layout,
                                   const std::vector<JointFactor>& factors) {
  const long p = static_cast<long>(layout.linear.size());
  VecX<double> sigma = VecX<double>::Ones(static_cast<long>(factors.size()));
  for (std::size_t j = 0; j < factors.size(); ++j)
    sigma[static_cast<long>(j)] = std::max(factors[j].rmse(VecX<double>::Zero(p)), 1e-12);
  MatX<double> R;
  VecX<double> d;
  stack(factors, sigma, p, R, d);
  std::vector<int> links, out;
  for (const int c : free_columns(layout))
    if (layout.linear[c].dof >= 0) links.push_back(c);
  if (links.empty()) return out;
  MatX<double> L = R(Eigen::all, links);
  for (long k = 0; k < L.cols(); ++k) L.col(k) /= std::max(L.col(k).norm(), 1e-300);
  Eigen::ColPivHouseholderQR<MatX<double>> qr(L);
  qr.setThreshold(kStructuralTol);
  for (const int c : free_columns(layout)) {
    if (layout.linear[c].dof >= 0 || layout.linear[c].theta >= 0) continue;
    const VecX<double> g = R.col(c);
    // Of a dependent column rounding leaves 1e-12 (observed); of any other, noise alone leaves
    // 1e-5.
    if (g.norm() > 0.0 && (L * qr.solve(g) - g).norm() < 1e-7 * g.norm()) out.push_back(c);
  }
  return out;
}

namespace {

/// Held values that no body has would leave the barrier nothing to start from.
void require_consistent(const FitLayout& layout, int b, const VecX<double>& x) {
  Theta<double> t;
  std::copy_n(x.data() + b, kThetaSize, t.begin());
  const auto held = [&](int k) { return layout.linear[static_cast<std::size_t>(b + k)].fixed; };
  int fixed = 0;
  for (int k = 0; k < kThetaSize; ++k) fixed += held(k) ? 1 : 0;
  if (fixed == 0 || fixed == kThetaSize || smallest_pseudo_inertia_eigenvalue(t) > 0.0) return;
  const std::string& name = layout.linear[static_cast<std::size_t>(b)].name;
  throw ModelError("fix: no body has the values that are held of " +
                   name.substr(0, name.rfind('.')) +
                   "; hold a mass above 0, a center of mass, or all ten of its parameters");
}

}  // namespace

LinearFit fit_linear(const FitLayout& layout, const std::vector<JointFactor>& factors,
                     const LinearFitOptions& options) {
  const long p = static_cast<long>(layout.linear.size());
  const long n = static_cast<long>(factors.size());
  const std::vector<int> free = free_columns(layout);
  long rows = 0;
  for (const JointFactor& f : factors) rows += f.factor.rows();
  if (rows == 0)
    throw DataError(
        "identify: no torque sample is left after filtering: no joint with a torque moves, or no "
        "stretch is long enough for the filter; record a motion, e.g. one of `diffnea excite`");
  if (free.empty())
    throw ModelError(
        "identify: every parameter is held, nothing is left to fit; groups of fit: inertia, "
        "armature, effects");
  if (rows < static_cast<long>(free.size()))
    throw DataError("identify: " + std::to_string(rows) + " torque samples after filtering for " +
                    std::to_string(free.size()) +
                    " parameters; record longer, raise the decimation rate, or fix parameters");

  const VecX<double> scale = parameter_scales(layout, factors);
  ConvexFitProblem problem;
  problem.start = consistent_start(layout, scale);
  if (options.physical) problem.bodies = layout.bodies();
  for (long k = 0; k < p; ++k)
    if (layout.linear[k].sign != Sign::kFree) problem.nonnegative.push_back(static_cast<int>(k));
  for (long k = 0; k < p; ++k)
    if (layout.linear[k].fixed) {
      problem.fixed.push_back(static_cast<int>(k));
      problem.start[k] = layout.linear[k].prior;
    }
  for (const int b : problem.bodies) require_consistent(layout, b, problem.start);
  problem.entropic_prior = options.entropic_prior;
  VecX<double> weak = VecX<double>::Zero(p);
  for (const int k : free) weak[k] = 1.0 / std::pow(options.prior_width * scale[k], 2);
  problem.prior_information = weak.asDiagonal();

  // Noise of each joint: weights and parameters in turn, from the factors alone.
  LinearFit fit;
  fit.sigma = VecX<double>::Ones(n);
  for (long j = 0; j < n; ++j)
    if (factors[j].factor.rows() > 0) {
      const double torque = factors[j].rmse(VecX<double>::Zero(p));
      fit.sigma[j] =
          std::max(torque > 0.0 ? torque : link_torque(layout, factors[j], problem.start), 1e-12);
    }
  const bool has_torque = std::ranges::any_of(
      factors, [&](const JointFactor& f) { return f.rmse(VecX<double>::Zero(p)) > 0.0; });
  VecX<double> at = problem.start;
  for (int round = 0; round < options.max_reweightings; ++round) {
    stack(factors, fit.sigma, p, problem.R, problem.d, has_torque ? &at : nullptr);
    fit.solver = solve_convex_fit(problem);
    fit.x = fit.solver.x;
    double change = 0.0;
    for (long j = 0; j < n; ++j) {
      const JointFactor& f = factors[j];
      if (f.factor.rows() == 0) continue;
      // Every joint pays for the parameters by its share of the rows.
      const double dof =
          static_cast<double>(f.factor.rows()) *
          std::max(1.0 - static_cast<double>(free.size()) / static_cast<double>(rows), 0.1);
      const double torque = f.rmse(VecX<double>::Zero(p));
      const double size = torque > 0.0 ? torque : link_torque(layout, f, problem.start);
      const double next = std::max(std::sqrt(f.sum_of_squares(fit.x) / dof), 1e-9 * size + 1e-15);
      change = std::max(change, std::abs(next / fit.sigma[j] - 1.0));
      fit.sigma[j] = next;
      if (f.inertia.size() == 0) continue;
      const double now = f.inertia.dot(fit.x(f.columns)), before = f.inertia.dot(at(f.columns));
      change = std::max(change, std::abs(now / before - 1.0));
    }
    at = fit.x;
    if (change < 1e-3) break;
  }

  fit.scale = scale;
  fit.weak = weak;
  VecX<double> unused;
  MatX<double> R;
  stack(factors, fit.sigma, p, R, unused, has_torque ? &at : nullptr);
  fit.information = R.transpose() * R;
  fit.base_parameters = base_parameters(layout, R, fit.x, scale);
  fit.rank = static_cast<int>(fit.base_parameters.size());
  use_sandwich(layout, fit.information, fit);
  return fit;
}

void use_sandwich(const FitLayout& layout, const MatX<double>& meat, LinearFit& fit) {
  require_size("use_sandwich: meat", meat.rows(), fit.x.size(), "parameter");
  const std::vector<int> free = free_columns(layout);
  const long p = fit.x.size(), f = static_cast<long>(free.size());
  MatX<double> H = fit.information(free, free), B = meat(free, free);
  const double ratio = std::max(1.0, B.trace() > 0.0 && H.trace() > 0.0 ? mean_ratio(B, H) : 1.0);
  H.diagonal() += fit.weak(free);
  B.diagonal() += fit.weak(free);
  const VecX<double> s = H.diagonal().cwiseSqrt().cwiseInverse();
  const MatX<double> inverse = s.asDiagonal() *
                               Eigen::LDLT<MatX<double>>(s.asDiagonal() * H * s.asDiagonal())
                                   .solve(MatX<double>(MatX<double>::Identity(f, f))) *
                               s.asDiagonal();
  MatX<double> covariance = MatX<double>::Zero(p, p), independent = covariance;
  covariance(free, free) = inverse * B * inverse;
  independent(free, free) = inverse;
  fit.std = VecX<double>::Zero(p);
  fit.identifiable.assign(static_cast<std::size_t>(p), false);
  for (const int c : free) {
    const double std = std::sqrt(std::max(covariance(c, c), independent(c, c)));
    fit.identifiable[static_cast<std::size_t>(c)] = std < fit.scale[c];
    fit.std[c] = std < fit.scale[c] ? std : std::numeric_limits<double>::quiet_NaN();
  }
  for (BaseParameter& b : fit.base_parameters) {
    VecX<double> c = VecX<double>::Zero(p);
    for (std::size_t k = 0; k < b.columns.size(); ++k) c[b.columns[k]] = b.coefficients[k];
    b.std = std::sqrt(std::max(c.dot(covariance * c), c.dot(independent * c)));
  }
  fit.information /= ratio;
}

}  // namespace diffnea
