#include "diagnose/base.hpp"

#include <algorithm>
#include <cmath>

#include "core/decompositions.hpp"
#include "diagnose/reference.hpp"
#include "diagnose/thresholds.hpp"

namespace diffnea {
namespace {

/// Of ln v₀: what is nearer, the base's columns follow where the evidence is.
constexpr double kFar = 0.1;

/// By how much friction may turn before the velocity does, as one standard deviation and at once
/// [s]: a soft contact of a simulator stops a joint in about that time (MuJoCo's default: 9.5 ms).
constexpr double kEarly = 10e-3;
/// Largest such time [s]: beyond, something else is late.
constexpr double kEarliest = 15e-3;

/// Change of a joint's ln inertia: the band of its rows moves by half of that.
constexpr double kHeavier = 0.2;

/// Factors of the linear parameters alone.
std::vector<JointFactor> linear_factors(const Evidence& evidence, const FitLayout& layout) {
  const int p = static_cast<int>(layout.linear.size());
  std::vector<JointFactor> out;
  for (const JointFactor& f : evidence.factors()) {
    std::vector<int> columns = f.columns;
    std::erase_if(columns, [&](int c) { return c >= p; });
    JointFactor kept{columns, TriangularFactor(static_cast<int>(columns.size()))};
    const long k = std::ssize(columns);  // they come first
    if (f.inertia.size() > 0) kept.inertia = f.inertia.head(k);
    if (f.factor.rows() > 0) {
      RowMatX<double> rows = RowMatX<double>::Zero(f.factor.R().rows() + 1, k + 1);
      rows.topLeftCorner(rows.rows() - 1, k) = f.factor.R().leftCols(k);
      rows.col(k).head(rows.rows() - 1) = f.factor.d();
      rows(rows.rows() - 1, k) = std::sqrt(f.factor.residual_sum_of_squares());
      kept.factor.add(rows);
    }
    out.push_back(std::move(kept));
  }
  return out;
}

/// Linear parameters by the rows as they are weighed now; the model's, where these are too few.
VecX<double> fitted(const Evidence& evidence, const FitLayout& layout) {
  const std::vector<JointFactor> factors = linear_factors(evidence, layout);
  long rows = 0;
  for (const JointFactor& f : factors) rows += f.factor.rows();
  return rows < std::ssize(layout.linear) ? layout.prior() : fit_linear(layout, factors).x;
}

/// One over the standard deviation of the torque's instant [1/sample]: of a uniform distribution.
double of_instant(const Evidence& evidence) {
  return std::sqrt(12.0) / (evidence.latest_instant() - evidence.earliest_instant());
}

}  // namespace

BasePrior base_prior(Base base, const Model& model, const FitLayout& layout,
                     const Evidence& evidence) {
  BasePrior out;
  const long linear = std::ssize(layout.linear);
  const long turns = evidence.base().cols() - linear;  // and the torque's instant
  const double instant = of_instant(evidence);
  out.x0 = VecX<double>::Zero(linear + turns);
  out.x0.head(linear) = layout.prior();
  // The rows of passive joints are linear about x₀ (Projection), and what no row tells is there.
  // Where no torque tells a scale, the model's stays.
  if (base == Base::kRefit && evidence.driven()) out.x0.head(linear) = fitted(evidence, layout);
  if (base == Base::kFixed) {  // how sharply friction turns is no claim of the model
    for (long s = 0; s < turns; ++s) out.free.push_back(static_cast<int>(linear + s));
    out.root = MatX<double>::Identity(turns, turns);
    out.root(turns - 1, turns - 1) = instant;
    return out;
  }
  for (std::size_t k = 0; k < layout.linear.size(); ++k)
    if (!layout.linear[k].fixed) out.free.push_back(static_cast<int>(k));
  const double width = LinearFitOptions{}.prior_width;
  VecX<double> scale(linear + turns);
  scale << parameter_scales(layout, linear_factors(evidence, layout)),
      VecX<double>::Constant(turns, 1.0 / width);  // a factor of e, 1 ms
  scale[linear + turns - 1] = 1.0 / (instant * width);
  for (long s = 0; s < turns; ++s) out.free.push_back(static_cast<int>(linear + s));
  const long p = std::ssize(out.free);
  MatX<double> weak = MatX<double>::Zero(p, p);
  for (long k = 0; k < p; ++k) weak(k, k) = 1.0 / (width * scale[out.free[k]]);
  if (base != Base::kPrior) {
    out.root = weak;
    return out;
  }
  const Posterior& posterior = *model.posterior;
  const long n = std::ssize(posterior.names);
  const MatX<double> information =
      Eigen::Map<const MatX<double>>(posterior.information.data(), n, n);
  const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(information);
  MatX<double> root(n, p);
  root.setZero();
  const MatX<double> L =
      eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
  for (long i = 0; i < n; ++i)
    for (long k = 0; k < p; ++k)
      if (out.free[k] < linear && layout.linear[out.free[k]].name == posterior.names[i])
        root.col(k) = L.col(i);
  out.root.resize(n + p, p);
  out.root << root, weak;
  return out;
}

std::string hold_scale(const Evidence& evidence, FitLayout& layout) {
  if (evidence.driven()) return "";
  FitParameter* largest = nullptr;
  double most = 0.0;
  for (std::size_t k = 0; k < layout.linear.size(); ++k) {
    FitParameter& p = layout.linear[k];
    const double torque = std::abs(p.prior) * evidence.base().col(k).norm();
    if (p.fixed && torque > 0.0) return "";
    if (torque <= most) continue;
    most = torque;
    largest = &p;
  }
  if (!largest) return "";
  largest->fixed = true;
  return largest->name;
}

bool fit_turns(Base base, const Evidence& evidence, const VecX<double>& torque, FitLayout& layout,
               VecX<double>& early) {
  const long p = std::ssize(layout.linear), m = evidence.times();
  const long smoothing = std::ranges::count_if(layout.shape, is_smoothing);
  if (smoothing == 0) return false;
  if (early.size() == 0) early = VecX<double>::Zero(evidence.num_dofs());
  const auto earlier = [&](long s) { return p + smoothing + kTurnColumns * s; };
  const long width = evidence.base().cols();
  VecX<double> root = VecX<double>::Zero(width);
  root.tail(width - p).setOnes();  // a factor of e is the prior's width
  for (long s = 0; s < smoothing; ++s) root[earlier(s)] = kEarlier / kEarly;
  root[width - 1] = of_instant(evidence);
  // Joints weighted by what the fit leaves of each.
  const VecX<double> x0 = base == Base::kRefit ? fitted(evidence, layout) : layout.prior();
  MatX<double> K = root.cwiseAbs2().asDiagonal();
  VecX<double> k = VecX<double>::Zero(width);
  for (std::size_t j = 0; j < evidence.joints().size(); ++j) {
    const auto rows = evidence.base().middleRows(j * m, m);
    const VecX<double> left = torque.segment(j * m, m) - rows.leftCols(p) * x0;
    const JointFactor& f = evidence.factors()[evidence.joints()[j]];
    const double weight =
        static_cast<double>(m) / std::max(f.factor.residual_sum_of_squares(), 1e-300);
    K.noalias() += weight * (rows.transpose() * rows);
    k.noalias() += weight * (rows.transpose() * left);
  }
  std::vector<int> free;
  for (long c = 0; c < width; ++c)
    if (c >= p || (base != Base::kFixed && !layout.linear[c].fixed))
      free.push_back(static_cast<int>(c));
  MatX<double> A = K(free, free);
  for (long c = 0; c < A.rows(); ++c)
    if (free[c] < p) A(c, c) += 1e-9 * A(c, c) + 1e-300;
  const VecX<double> b = k(free);
  const Eigen::LDLT<MatX<double>> factor(A);
  const VecX<double> of_free = factor.solve(b);
  const MatX<double> inverse =
      factor.solve(MatX<double>(MatX<double>::Identity(A.rows(), A.rows())));
  VecX<double> step = VecX<double>::Zero(width), variance = step;
  step(free) = of_free;
  variance(free) = inverse.diagonal();
  const auto worth = [](double value, double most) {
    const double out = std::isfinite(value) ? std::clamp(value, -most, most) : 0.0;
    return std::abs(out) > kFar * most ? out : 0.0;
  };
  const double sure = kToldApart + std::log(static_cast<double>(m));  // BIC
  bool moved = false;
  long s = 0;
  for (FitParameter& shape : layout.shape) {
    if (!is_smoothing(shape)) continue;
    const double sharper = worth(step[p + s], 1.0);
    shape.prior *= std::exp(sharper);
    moved |= sharper != 0.0;
    const std::vector<int>& joints = layout.effects[shape.effect].joints;
    const long column = earlier(s++);
    if (joints.size() != 1) continue;
    double& at = early[joints.front()];
    const double now = at + kEarlier * step[column],
                 off = kEarlier * std::sqrt(sure * variance[column]);
    // Beyond doubt, as much as a contact may be, and never late: else with the velocity.
    const bool is_early = now > off && now < kEarliest;
    const double by = worth((is_early ? now : 0.0) - at, kEarly);
    if (by == 0.0) continue;
    at += by;
    moved = true;
  }
  return moved;
}

Model refitted(Base base, const Model& model, const FitLayout& layout, const Evidence& evidence) {
  if (base != Base::kRefit) return model;
  VecX<double> x = VecX<double>::Zero(evidence.base().cols());  // friction turns as it is read
  x.head(std::ssize(layout.linear)) = fitted(evidence, layout);
  return base_at(model, layout, x, {});
}

bool is_heavier(const Model& model, const Model& before, const Evidence& evidence) {
  return std::ranges::any_of(evidence.series(), [&](const JointSeries& s) {
    const VecX<double> amid = s.q.row(s.rows() / 2).transpose();
    const auto inertias = [&](const Model& of) -> VecX<double> {
      return evidence.driven_rows().inertias(extend(of, evidence.runs(), s.run).tree, amid);
    };
    const VecX<double> now = inertias(model), then = inertias(before);
    return std::ranges::any_of(
        evidence.joints(), [&](int j) { return std::abs(std::log(now[j] / then[j])) > kHeavier; });
  });
}

VecX<double> final_base(Base base, const FitLayout& layout, const Search& search,
                        const std::vector<Term>& terms, const VecX<double>& beside,
                        LinearFit& fit) {
  const Evidence& evidence = search.evidence();
  VecX<double> effects = torque_of(terms, evidence.rows());
  if (beside.size() > 0) effects += beside;
  VecX<double> x = search.projection().parameters(effects);
  if (base != Base::kRefit) return x;
  const long p = std::ssize(layout.linear), turns = x.size() - p;
  MatX<double> all(evidence.rows(), p + 1);
  all << evidence.base().leftCols(p),
      evidence.torque() - effects - evidence.base().rightCols(turns) * x.tail(turns);
  const MatX<double> rows = search.whitener()(all);
  std::vector<JointFactor> factors;
  std::size_t known = 0;
  for (int j = 0; j < evidence.num_dofs(); ++j) {
    std::vector<int> columns = evidence.factors()[j].columns;
    std::erase_if(columns, [&](int c) { return c >= p; });
    factors.push_back({columns, TriangularFactor(static_cast<int>(columns.size()))});
    if (known >= evidence.joints().size() || evidence.joints()[known] != j) continue;
    // An effect at a passive joint is a torque that is not zero: it has a scale.
    if (const VecX<double>& of = evidence.factors()[j].inertia; of.size() > 0)
      factors.back().inertia = of.head(std::ssize(columns));
    const long begin = static_cast<long>(known++) * evidence.times();
    std::vector<long> used;
    for (long i = begin; i < begin + evidence.times(); ++i)
      if (search.whitener().kept()[i]) used.push_back(i);
    RowMatX<double> block(std::ssize(used), std::ssize(columns) + 1);
    for (std::size_t c = 0; c < columns.size(); ++c) block.col(c) = rows.col(columns[c])(used);
    block.col(block.cols() - 1) = rows.col(p)(used);
    factors.back().factor.add(block);
  }
  fit = fit_linear(layout, factors);
  x.head(p) = fit.x;
  return x;
}

}  // namespace diffnea
