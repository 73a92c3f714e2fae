#include "diagnose/refine.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "core/decompositions.hpp"

namespace diffnea {
namespace {

/// A shape whose derivative the linear parameters reproduce but for this share cannot be told from
/// them.
constexpr double kRedundant = 0.02;
/// χ²: what one or the other makes of a choice that the recording shows.
constexpr double kSideShows = 1.0;
/// Of a joint's measured torque: more, that the base takes back, is of a candidate which the base
/// hides. Of a force in plain sight (share of its torque that the base leaves), like a spring that
/// carries a weight, it may be any.
constexpr double kWhole = 0.95, kPlainSight = 0.02;
constexpr double kMostGainError = 0.5;  ///< beyond, no torque constant is off
/// Of a shape in one step: of its logarithm; of a ratio, which is about 1.
constexpr double kMostLog = 0.7, kMostPlain = 0.3;

/// Drops shapes whose derivatives D the columns G reproduce. @return whether there were any
bool drop_redundant(const MatX<double>& G, const MatX<double>& D, Term& term) {
  const Eigen::HouseholderQR<MatX<double>> qr(G);
  const MatX<double> Q = columns_of_q(qr.householderQ(), G.rows(), G.cols());
  std::vector<int> kept;
  for (long s = 0; s < D.cols(); ++s) {
    const double left = (D.col(s) - Q * (Q.transpose() * D.col(s))).norm();
    if (left > kRedundant * D.col(s).norm())
      kept.push_back(term.shapes[static_cast<std::size_t>(s)]);
  }
  const bool dropped = kept.size() < term.shapes.size();
  term.shapes = std::move(kept);
  return dropped;
}

/// Its shapes refined, its choices as they are.
Term descended(const Search& search, Term term, const std::vector<Term>& terms) {
  const Candidate& c = search.candidates()[static_cast<std::size_t>(term.candidate)];
  std::vector<Term> all = terms;
  all.push_back(std::move(term));
  double gain = search.fit(all);
  if (c.nonlinear) {  // the torque at the fitted values instead of its straight line
    search.set_columns(all.back());
    gain = std::max(search.gain_at(all), 0.0);
  }
  double shrink = 1.0;
  for (int step = 0; step < 12 && (!all.back().shapes.empty() || c.nonlinear); ++step) {
    const Stack S = stack(all, search.projection().residual().size());
    const MatX<double> D = search.projection().project(
        search.evidence().columns(all.back().effect, all.back().shapes));
    if (step == 0 && drop_redundant(S.G, D, all.back())) {
      if (all.back().shapes.empty() && !c.nonlinear) break;
      continue;
    }
    const long shapes = D.cols();
    MatX<double> J(S.G.rows(), S.G.cols() + shapes);
    J << S.G, D;
    MatX<double> K = J.transpose() * J;
    VecX<double> scale = K.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
    K = scale.asDiagonal() * K * scale.asDiagonal();
    K.diagonal().array() += 1e-6;
    const VecX<double> rhs =
        scale.cwiseProduct(J.transpose() * (search.projection().residual() - S.offset));
    const VecX<double> x = scale.cwiseProduct(K.ldlt().solve(rhs));
    const VecX<double> now_values = all.back().values();
    std::vector<Term> fitted = all;
    search.fit(fitted);
    const VecX<double> target = fitted.back().values();
    bool better = false;
    const double before = gain;
    for (; shrink > 0.02 && !better; shrink *= better ? 1.0 : 0.3) {
      std::vector<Term> trial = all;
      Term& moved = trial.back();
      for (std::size_t k = 0; k < moved.linear.size(); ++k)
        moved.effect.parameters[static_cast<std::size_t>(moved.linear[k])] =
            now_values[static_cast<long>(k)] + shrink * (target - now_values)[static_cast<long>(k)];
      for (long s = 0; s < shapes; ++s) {
        const std::size_t k = static_cast<std::size_t>(moved.shapes[static_cast<std::size_t>(s)]);
        const auto at = std::ranges::find(c.shapes, static_cast<int>(k));
        double& value = moved.effect.parameters[k];
        const double by = shrink * x[S.G.cols() + s];
        if (scale_of(moved, static_cast<int>(k)) == Scale::kLog)
          value *= std::exp(std::clamp(by, -kMostLog, kMostLog));
        else
          value += std::clamp(by, -kMostPlain, kMostPlain);
        if (at == c.shapes.end()) continue;
        const std::size_t bound = static_cast<std::size_t>(at - c.shapes.begin());
        value = std::clamp(value, c.shape_low[bound], c.shape_high[bound]);
      }
      search.set_columns(moved);
      const double now = c.nonlinear ? search.gain_at(trial) : search.fit(trial);
      if (now > gain) {
        gain = now;
        all = std::move(trial);
        better = true;
      }
    }
    shrink = std::min(1.0, 3.0 * shrink);
    if (!better || gain - before < 0.02) break;  // far inside one unit of χ²
  }
  return all.back();
}


/// Where stiffness and rotor of a spring show as their ratio alone: the rotor as declared.
void hold_rotor(const Search& search, Term& term) {
  const Candidate& c = search.candidates()[static_cast<std::size_t>(term.candidate)];
  double* p = term.effect.parameters.data();  // stiffness, damping, inertia
  if (!(c.rotor > 0.0) || term.shapes.size() >= c.shapes.size() || !(p[2] > 0.0)) return;
  if (encoder_at_motor(term.effect)) return;  // the link's inertia over the stiffness shows
  const double by = c.rotor / p[2];
  for (int k = 0; k < 3; ++k) p[k] *= by;
  search.set_columns(term);
}

}  // namespace

Term with_shapes_refined(const Search& search, Term term, const std::vector<Term>& terms) {
  Term out = descended(search, std::move(term), terms);
  hold_rotor(search, out);
  return out;
}

Term refined(const Search& search, Term term, const std::vector<Term>& terms) {
  Term best = descended(search, std::move(term), terms);
  const auto gain_with = [&](const Term& t) {
    std::vector<Term> with = terms;
    with.push_back(t);
    return search.fit(with);
  };
  // What is one or the other, each with the shapes that suit it.
  for (const int k : search.candidates()[static_cast<std::size_t>(best.candidate)].choices) {
    const Term from = best;
    for (const double value : from.effect.parameter_info[static_cast<std::size_t>(k)].choices) {
      if (value == from.effect.parameters[static_cast<std::size_t>(k)]) continue;
      Term other = from;
      other.effect.parameters[static_cast<std::size_t>(k)] = value;
      search.set_columns(other);
      other = descended(search, std::move(other), terms);
      const double gain = gain_with(other) - gain_with(best);
      if (plausible(search, other) == plausible(search, best) ? gain > kSideShows
                                                              : plausible(search, other))
        best = std::move(other);
    }
  }
  hold_rotor(search, best);
  return best;
}

bool impossible(const Term& term) {
  return std::ranges::any_of(term.linear, [&](int k) {
    return term.effect.parameter_info[static_cast<std::size_t>(k)].name == "gain_error" &&
           std::abs(term.effect.parameters[static_cast<std::size_t>(k)]) > kMostGainError;
  });
}

bool plausible(const Search& search, const Term& term) {
  // A rotor that its spring's damper does not let swing is a lag by another name; a rotor that the
  // encoder sees is none.
  const bool hidden =
      !term.effect.own && hides_motor(term.effect) && !encoder_at_motor(term.effect);
  if (hidden) {
    const MotorSpring<double> s = motor_spring(term.effect);
    if (s.damping * s.damping > 4.0 * s.stiffness * s.inertia) return false;
  }
  // A hidden rotor without inertia only bends the friction that turns with it.
  for (const int k : term.linear)
    if (hidden && term.effect.parameter_info[static_cast<std::size_t>(k)].name == "motor_inertia" &&
        !(term.effect.parameters[static_cast<std::size_t>(k)] > 0.0))
      return false;
  // At the least distance that shows, bristles are Coulomb friction; at the largest, a spring.
  const Candidate& c = search.candidates()[static_cast<std::size_t>(term.candidate)];
  for (std::size_t s = 0; s < c.shapes.size(); ++s) {
    const std::size_t k = static_cast<std::size_t>(c.shapes[s]);
    if (term.effect.parameter_info[k].name == "presliding" &&
        !(term.effect.parameters[k] > c.shape_low[s] &&
          term.effect.parameters[k] < c.shape_high[s]))
      return false;
  }
  if (impossible(term)) return false;
  if (term.effect.info().port == Port::kJointTorque && term.visible_share() > kPlainSight)
    return true;
  const VecX<double> torque = term.torque();
  const long m = search.evidence().times();
  for (long k = 0; k < static_cast<long>(search.evidence().joints().size()); ++k)
    if (torque.segment(k * m, m).norm() >
        kWhole * search.evidence().size(k) * std::sqrt(static_cast<double>(m)))
      return false;
  return true;
}

}  // namespace diffnea
