#include "diagnose/refine.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "diagnose/resonance.hpp"
#include "diagnose/selection_terms.hpp"
#include "diagnose/signed_fit.hpp"

namespace diffnea {
namespace {

/// A shape whose derivative the linear parameters reproduce but for this share cannot be told from
/// them.
constexpr double kRedundant = 0.02;
/// χ²: what one or the other makes of a choice that the recording shows.
constexpr double kSideShows = 1.0;
/// Share of a joint's measured torque: more, that the base takes back, is of a candidate which the
/// base hides. A force in plain sight (share of its torque that the base leaves), like a spring
/// that carries a weight, may have any; what acts at several joints, like a payload at a wrist that
/// carries nothing else, where the base leaves most of it.
constexpr double kWhole = 0.95, kPlainSight = 0.02, kMostlySeen = 0.5;
/// Beyond, no torque constant is off.
constexpr double kMostGainError = 0.5;
/// Beyond, an encoder's scale is another gear's or encoder's: no robot would reach what it aims at.
constexpr double kMostScaleError = 0.25;
/// Beyond, a spring pulls alike wherever the joint is, and is an offset: five turns of a joint, or
/// what no slide is long [rad, m].
constexpr double kMostRest = 30.0;
/// Of a shape in one step: of its logarithm; of a ratio, which is about 1.
constexpr double kMostLog = 0.7, kMostPlain = 0.3;

/// Drops shapes whose derivatives D the columns before them reproduce.
/// @param K  products of [columns | D]  @return whether there were any
bool drop_redundant(const MatX<double>& K, Term& term) {
  const long columns = K.cols() - std::ssize(term.shapes);
  std::vector<int> kept;
  for (long s = columns; s < K.cols(); ++s)
    if (left_beside(K.topLeftCorner(columns, columns), K.col(s).head(columns), K(s, s)) >
        kRedundant * kRedundant * K(s, s))
      kept.push_back(term.shapes[s - columns]);
  const bool dropped = kept.size() < term.shapes.size();
  term.shapes = std::move(kept);
  return dropped;
}

/// Normal equations of linear parameters and shapes of the last of some terms.
NormalEquations with_shapes(const Search& search, const std::vector<const Term*>& terms,
                           const Beside& D) {
  NormalEquations out = search.normal(terms);
  const long before = out.b.size(), all = before + D.cols();
  out.K.conservativeResize(all, all);
  out.b.conservativeResize(all);
  out.K.bottomRightCorner(D.cols(), D.cols()) = product(D, D);
  out.b.tail(D.cols()) = search.projection().with_residual(D);
  for (long at = 0; const Term* t : terms) {
    const MatX<double> both = product(t->beside, D);
    const long k = t->width();
    out.K.block(at, before, k, D.cols()) = both.topRows(k);
    out.K.block(before, at, D.cols(), k) = both.topRows(k).transpose();
    if (t->has_offset()) out.b.tail(D.cols()) -= both.row(k).transpose();
    at += k;
  }
  return out;
}

/// Its shapes refined, its choices as they are.
Term descended(const Search& search, Term term, const std::vector<Term>& terms) {
  const Candidate& c = search.candidate(term);
  std::vector<const Term*> all;
  for (const Term& t : terms) all.push_back(&t);
  all.push_back(&term);
  VecX<double> x;  // linear parameters of all, as they are
  const auto best = [&](const NormalEquations& n) { return signed_fit(n.K, n.b, n.sign); };
  const auto removed = [&](const NormalEquations& n, const VecX<double>& at) {
    return 2.0 * n.b.dot(at) - at.dot(n.K * at) + search.residual_sum() - n.left;
  };
  const auto set = [](Term& t, const VecX<double>& values) {
    for (std::size_t k = 0; k < t.linear.size(); ++k) t.effect.parameters[t.linear[k]] = values[k];
  };
  const NormalEquations at_start = search.normal(all);
  x = best(at_start).x;
  double gain = removed(at_start, x);
  if (c.nonlinear) {  // the torque at the fitted values instead of its straight line
    const Term from = term;
    VecX<double> as_it_is = x;
    as_it_is.tail(term.width()) = term.values();
    const double stays = removed(at_start, as_it_is);
    set(term, x.tail(term.width()));
    search.set_columns(term);
    gain = removed(search.normal(all), x);
    if (stays > gain) {  // too far for a straight line
      term = from;
      x = as_it_is;
      gain = stays;
    }
    gain = std::max(gain, 0.0);
  } else {
    set(term, x.tail(term.width()));
  }
  double shrink = 1.0;
  for (int step = 0; step < 12 && (!term.shapes.empty() || c.nonlinear); ++step) {
    const Beside D =
        search.projection().beside(search.evidence().columns(term.effect, term.shapes));
    const NormalEquations n = with_shapes(search, all, D);
    if (step == 0 && drop_redundant(n.K, term)) {
      if (term.shapes.empty() && !c.nonlinear) break;
      continue;
    }
    const long shapes = D.cols(), linear = n.b.size() - shapes;
    const VecX<double> move = ridge_solve(n.K, n.b, 1e-6);
    const VecX<double> now_values = term.values();
    const VecX<double> target =
        signed_fit(n.K.topLeftCorner(linear, linear), n.b.head(linear), n.sign)
            .x.tail(term.width());
    bool better = false;
    const double before = gain;
    for (; shrink > 0.02 && !better; shrink *= better ? 1.0 : 0.3) {
      Term moved = term;
      set(moved, now_values + shrink * (target - now_values));
      for (long s = 0; s < shapes; ++s) {
        const std::size_t k = static_cast<std::size_t>(moved.shapes[s]);
        const auto at = std::ranges::find(c.shapes, static_cast<int>(k));
        double& value = moved.effect.parameters[k];
        const double by = shrink * move[linear + s];
        if (scale_of(moved, static_cast<int>(k)) == Scale::kLog)
          value *= std::exp(std::clamp(by, -kMostLog, kMostLog));
        else
          value += std::clamp(by, -kMostPlain, kMostPlain);
        if (at == c.shapes.end()) continue;
        const std::size_t bound = static_cast<std::size_t>(at - c.shapes.begin());
        value = std::clamp(value, c.shape_low[bound], c.shape_high[bound]);
      }
      search.set_columns(moved);
      all.back() = &moved;
      const NormalEquations there = search.normal(all);
      VecX<double> at = x;
      at.tail(moved.width()) = moved.values();
      if (!c.nonlinear) at = best(there).x;
      const double now = removed(there, at);
      all.back() = &term;
      if (!(now > gain)) continue;
      gain = now;
      x = at;
      set(moved, x.tail(moved.width()));
      term = std::move(moved);
      better = true;
    }
    shrink = std::min(1.0, 3.0 * shrink);
    if (!better || gain - before < 0.02) break;  // far inside one unit of χ²
  }
  return term;
}

/// Where stiffness and rotor of a spring show as their ratio alone: the rotor as declared.
void hold_rotor(const Search& search, Term& term) {
  const Candidate& c = search.candidate(term);
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
    std::vector<Term> with = joined(terms, t);
    return search.fit(with);
  };
  // What is one or the other, each with the shapes that suit it.
  for (const int k : search.candidate(best).choices) {
    const Term from = best;
    for (const double value : from.effect.parameter_info[k].choices) {
      if (value == from.effect.parameters[k]) continue;
      Term other = from;
      other.effect.parameters[k] = value;
      search.set_columns(other);
      other = descended(search, std::move(other), terms);
      const double gain = gain_with(other) - gain_with(best);
      if (plausible(search, other) == plausible(search, best) ? gain > kSideShows
                                                              : plausible(search, other))
        best = std::move(other);
    }
  }
  if (!best.effect.own && encoder_at_motor(best.effect)) {
    Term other = descended(search, narrowed(search, best, terms), terms);
    if (gain_with(other) > gain_with(best)) best = std::move(other);
  }
  hold_rotor(search, best);
  return best;
}

bool impossible(const Term& term) {
  for (std::size_t k = 0; k < term.effect.parameter_info.size(); ++k) {
    const std::string& name = term.effect.parameter_info[k].name;
    const double most = name == "gain_error"    ? kMostGainError
                        : name == "scale_error" ? kMostScaleError
                        : name == "rest"        ? kMostRest
                                                : kInfinity;
    if (std::abs(term.effect.parameters[k]) > most) return true;
  }
  return false;
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
    if (hidden && term.effect.parameter_info[k].name == "motor_inertia" &&
        !(term.effect.parameters[k] > 0.0))
      return false;
  // At the least distance that shows, bristles are Coulomb friction; at the largest, a spring.
  const Candidate& c = search.candidate(term);
  for (std::size_t s = 0; s < c.shapes.size(); ++s) {
    const std::size_t k = static_cast<std::size_t>(c.shapes[s]);
    if (term.effect.parameter_info[k].name == "presliding" &&
        !(term.effect.parameters[k] > c.shape_low[s] &&
          term.effect.parameters[k] < c.shape_high[s]))
      return false;
  }
  if (impossible(term)) return false;
  const double seen = term.visible_share();
  if (term.effect.info().port == Port::kJointTorque && seen > kPlainSight) return true;
  const VecX<double> torque = term.torque();
  const Evidence& e = search.evidence();
  const long m = e.times();
  // Beside torques, those that cancel at a passive joint are its size one by one.
  const bool cancels = e.has_passive_beside_torques();
  for (long k = 0; k < std::ssize(e.joints()); ++k)
    if ((seen <= kMostlySeen || e.passive(k)) &&
        torque.segment(k * m, m).norm() >
            kWhole * (cancels ? e.scale(k) : e.size(k)) * std::sqrt(static_cast<double>(m)))
      return false;
  return true;
}

}  // namespace diffnea
