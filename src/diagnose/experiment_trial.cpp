#include "diagnose/experiment_trial.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>

#include "core/decompositions.hpp"
#include "diagnose/signed_fit.hpp"

namespace diffnea {
namespace {

constexpr int kGaussNewton = 6;         ///< steps of a rival's parameters
constexpr std::size_t kMostStarts = 8;  ///< of a rival's shapes
constexpr double kPassBand = 2.5;       ///< the filter's cut-off over the motion's fastest harmonic


std::unique_ptr<RecordingSource> source(const ExperimentContext& c, const Trajectory& t) {
  Recording r = imaginary_recording(t);
  for (const int j : c.joints) {  // what matters is that there is one
    r.has_tau[j] = true;
    r.tau.col(j).setOnes();
  }
  r.info.torque_side = c.link_side ? TorqueSide::kLink : TorqueSide::kMotor;
  r.info.torque_sampling = TorqueSampling::kInstant;
  std::vector<Recording> one;
  one.push_back(std::move(r));
  return recordings_in_memory(c.model, std::move(one));
}

PreprocessPlan plan(const ExperimentContext& c, double fastest_hz) {
  PreprocessPlan out = c.plan;
  out.filter_hz = std::max(out.filter_hz, std::min(kPassBand * fastest_hz, 0.4 / out.dt));
  return out;
}

/// The recording's own.
std::vector<JointNoise> noise(const ExperimentContext& c, const Evidence& evidence) {
  if (evidence.joints() != c.joints)
    throw ModelError("not every joint of the recording moves in the planned motion");
  return c.noise;
}

}  // namespace

ExperimentTrial::ExperimentTrial(const ExperimentContext& c, const Trajectory& motion,
                                 double fastest_hz)
    : context_(c),
      evidence_(c.model, {c.reference}, c.layout, *source(c, motion), plan(c, fastest_hz), 0.0, {}),
      whitener_(evidence_, noise(c, evidence_), {}),
      projection_(evidence_, whitener_, c.prior),
      seconds_(motion.time[motion.rows() - 1] - motion.time[0]) {
  evidence_.set_reference(c.reference);
  for (const Candidate& candidate : c.candidates)
    if (candidate.effect.own) evidence_.evaluate(candidate.effect);
}

double ExperimentTrial::separation(const CausePair& pair, double duration) {
  const double longer = duration / seconds_;
  const Term& cause = context_.terms[pair.term];
  others_ = basis_without(pair.term);
  const VecX<double> g = beside(evidence_.torque_of(cause.effect));
  const double left = longer * least(g, *pair.rival);
  const double n = longer * static_cast<double>(whitener_.used_rows());
  const auto size = [](const auto& x) {
    return static_cast<double>(x.linear.size() + x.shapes.size());
  };
  return n * std::log1p(left / n) + (size(*pair.rival) - size(cause)) * std::log(n);
}

MatX<double> ExperimentTrial::basis_without(std::size_t term) {
  MatX<double> all(projection_.residual().size(), 0);
  for (std::size_t i = 0; i < context_.terms.size(); ++i) {
    if (i == term) continue;
    if (columns_.empty()) columns_.resize(context_.terms.size());
    MatX<double>& columns = columns_[i];
    if (columns.size() == 0) {
      const Term& t = context_.terms[i];
      std::vector<int> which = t.linear;
      which.insert(which.end(), t.shapes.begin(), t.shapes.end());
      columns = projection_.project(evidence_.columns(t.effect, which));
    }
    const long before = all.cols();
    all.conservativeResize(Eigen::NoChange, before + columns.cols());
    all.rightCols(columns.cols()) = columns;
  }
  if (all.cols() == 0) return all;
  for (long c = 0; c < all.cols(); ++c) all.col(c) /= std::max(all.col(c).norm(), 1e-300);
  Eigen::ColPivHouseholderQR<MatX<double>> qr(all);
  qr.setThreshold(1e-6);
  return columns_of_q(qr.householderQ(), all.rows(), qr.rank());
}

MatX<double> ExperimentTrial::beside(const MatX<double>& columns) const {
  MatX<double> out = projection_.project(columns);
  if (others_.cols() > 0) out -= others_ * (others_.transpose() * out).eval();
  return out;
}

double ExperimentTrial::least(const VecX<double>& g, const Candidate& rival) const {
  double best = g.squaredNorm();
  TriedEffect effect = rival.effect, start = rival.effect;
  double at_start = std::numeric_limits<double>::infinity();
  // The best of its shapes, with the linear parameters that suit them.
  for (std::size_t p = 0; p < std::min(rival.grid.size(), kMostStarts); ++p) {
    const std::size_t spread =  // over the whole grid
        rival.grid.size() <= kMostStarts ? p : p * rival.grid.size() / kMostStarts;
    for (const int k : rival.linear) effect.parameters[k] = 0.0;
    rival.set(rival.grid[spread], effect);
    TriedEffect moved = effect;
    const double now = step(g, rival, rival.linear, moved,
                            (g - VecX<double>(beside(evidence_.torque_of(effect)))).squaredNorm());
    if (now < at_start) at_start = now, start = moved;
  }
  if (!std::isfinite(at_start)) return best;
  best = std::min(best, at_start);
  std::vector<int> all = rival.linear;
  all.insert(all.end(), rival.shapes.begin(), rival.shapes.end());
  if (rival.shapes.empty() && !rival.nonlinear) return best;
  for (int i = 0; i < kGaussNewton; ++i) {
    const double now = step(g, rival, all, start, best);
    if (!(now < best * (1.0 - 1e-3))) return std::min(best, now);
    best = now;
  }
  return best;
}

double ExperimentTrial::step(const VecX<double>& g, const Candidate& rival,
                             const std::vector<int>& which, TriedEffect& effect, double now) const {
  if (which.empty()) return now;
  const VecX<double> r = g - VecX<double>(beside(evidence_.torque_of(effect)));
  const MatX<double> J = beside(evidence_.columns(effect, which));
  const VecX<double> move = ridge_solve(J.transpose() * J, J.transpose() * r, 1e-9);
  for (double part = 1.0; part > 0.05; part *= 0.5) {
    TriedEffect moved = effect;
    for (std::size_t i = 0; i < which.size(); ++i) {
      const std::size_t k = static_cast<std::size_t>(which[i]);
      const ParameterInfo& info = effect.parameter_info[k];
      const double m = part * move[i];
      double& p = moved.parameters[k];
      if (scale(info) == Scale::kLog)
        p *= std::exp(std::clamp(m, -1.0, 1.0));
      else
        p += m;
      if (info.sign != Sign::kFree) p = std::max(p, 0.0);
    }
    for (std::size_t s = 0; s < rival.shapes.size(); ++s)
      moved.parameters[rival.shapes[s]] =
          std::clamp(moved.parameters[rival.shapes[s]], rival.shape_low[s], rival.shape_high[s]);
    const double next = (g - VecX<double>(beside(evidence_.torque_of(moved)))).squaredNorm();
    if (!(next < now)) continue;
    effect = moved;
    return next;
  }
  return now;
}

}  // namespace diffnea
