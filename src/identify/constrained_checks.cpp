#include "identify/constrained_checks.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>

#include "core/decompositions.hpp"
#include "core/statistics.hpp"
#include "identify/constrained_residuals.hpp"

namespace diffnea {
namespace {

/// Median of |g| over its noise from which a constraint that no parameter moves is a mistake.
constexpr double kMistaken = 10.0;

VecX<double> values_of(const std::vector<ConstrainedParameter>& parameters) {
  VecX<double> out(static_cast<Eigen::Index>(parameters.size()));
  for (Eigen::Index k = 0; k < out.size(); ++k) out[k] = parameters[k].value;
  return out;
}

/// Names of the constraints in whose span a row of equalities is.
std::string others_with(const ConstrainedSystem<double>& system, std::size_t row) {
  const std::size_t n = 6 * system.bodies.size();
  const auto covector = [&](const ConstraintRow<double>& of) {
    VecX<double> out = VecX<double>::Zero(static_cast<Eigen::Index>(n));
    for (std::size_t s = 0; s < kMostBodies; ++s)
      if (of.bodies[s] != kWorld &&
          system.bodies[static_cast<std::size_t>(of.bodies[s])].kind != BodyKind::kPrescribed)
        out.segment<6>(6 * of.bodies[s]) << to_eigen(of.J[s].torque), to_eigen(of.J[s].force);
    return out;
  };
  std::vector<std::size_t> others;
  for (std::size_t i = 0; i < system.rows.size(); ++i)
    if (system.rows[i].name != system.rows[row].name) others.push_back(i);
  if (others.empty()) return {};
  MatX<double> J(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(others.size()));
  for (std::size_t i = 0; i < others.size(); ++i)
    J.col(static_cast<Eigen::Index>(i)) = covector(system.rows[others[i]]);
  const VecX<double> target = covector(system.rows[row]);
  const VecX<double> share = Eigen::CompleteOrthogonalDecomposition<MatX<double>>(J).solve(target);
  constexpr double kInSpan = 1e-6;  // remainder, relative: rounding of a few products leaves 1e-12
  if ((J * share - target).norm() > kInSpan * target.norm()) return {};
  std::string out;
  for (std::size_t i = 0; i < others.size(); ++i) {
    const std::string& name = system.rows[others[i]].name;
    const auto k = static_cast<Eigen::Index>(i);
    if (std::abs(share[k]) * J.col(k).norm() <= kInSpan * target.norm()) continue;
    if (out.find("'" + name + "'") == std::string::npos)
      out += (out.empty() ? "'" : ", '") + name + "'";
  }
  return out;
}

}  // namespace

void require_bodies(const ConstrainedModel& model,
                    const std::vector<ConstrainedParameter>& parameters, const BodyMotion& motion) {
  if (motion.samples.empty() || parameters.empty())
    throw DataError("constrained loss: got " + std::to_string(motion.samples.size()) +
                    " samples and " + std::to_string(parameters.size()) +
                    " parameters, expected at least one of either");
  for (const BodySample& s : motion.samples)
    if (s.states.size() != motion.noise.size() || s.accelerations.size() != motion.noise.size())
      throw ShapeError("constrained loss: the sample at " + detail::number_text(s.time) +
                       " s has " + std::to_string(s.states.size()) + " states and " +
                       std::to_string(s.accelerations.size()) + " accelerations, expected " +
                       std::to_string(motion.noise.size()) + " as BodyMotion::noise has bodies");
  const ConstrainedSystem<double> first = model.at(motion.samples.front(), values_of(parameters));
  for (std::size_t b = 0; b < motion.noise.size(); ++b) {
    const BodyKind kind = first.bodies[b].kind;
    if (kind == BodyKind::kPrescribed) continue;
    if (!(motion.noise[b].position[2] > 0.0) ||
        (kind == BodyKind::kRigid && !(motion.noise[b].angle[2] > 0.0)))
      throw DataError("constrained loss: body " + std::to_string(b) +
                      " has a noise of its acceleration of " +
                      detail::number_text(motion.noise[b].position[2]) + " m/s² and " +
                      detail::number_text(motion.noise[b].angle[2]) +
                      " rad/s², expected more than 0; a body without extent is a particle(), one "
                      "that is driven is prescribed");
  }
}

void require_agreement(const ConstrainedModel& model,
                       const std::vector<ConstrainedParameter>& parameters,
                       const BodyMotion& motion) {
  const VecX<double> p = values_of(parameters);
  const ConstrainedSystem<double> first = model.at(motion.samples.front(), p);
  std::vector<bool> moves(first.rows.size(), false);
  for (Eigen::Index begin = 0; begin < p.size(); begin += kJetWidth) {
    const ConstrainedSystem<JetD> system = model.at(motion.samples.front(), seeded(p, begin));
    for (std::size_t i = 0; i < system.rows.size(); ++i)
      moves[i] = moves[i] || !system.rows[i].g.v.isZero(0.0);
  }
  for (std::size_t i = 0; i < first.rows.size(); ++i) {
    const ConstraintRow<double>& row = first.rows[i];
    const bool moved = std::ranges::any_of(first.rows, [&](const ConstraintRow<double>& other) {
      return other.name == row.name && moves[&other - first.rows.data()];
    });
    if (moved || row.relation == Relation::kAtMost) continue;
    const std::size_t order = row.of_velocity ? 1 : 0;
    std::vector<double> off;
    for (const BodySample& sample : motion.samples) {
      const ConstraintRow<double> there = model.at(sample, p).rows[i];
      off.push_back(std::abs(there.g) / row_noise(there, motion.noise, order));
    }
    const double usual = median(off);
    if (!(usual > kMistaken)) continue;
    const std::string others = others_with(first, i);
    double reach = 0.0;  // change of g by a metre of its bodies
    for (const Wrench<double>& J : row.J) reach = std::max(reach, std::sqrt(dot(J.force, J.force)));
    throw DataError(
        "constrained loss: constraint '" + row.name +
        "' has no free parameter and does not hold: " + "at the first sample, " +
        detail::number_text(motion.samples.front().time) + " s, its g is " +
        detail::number_text(row.g, 3) +
        (reach > 0.0 && !row.of_velocity
             ? ", a posture " + detail::number_text(1e3 * std::abs(row.g) / reach, 3) + " mm off"
             : "") +
        "; over all samples |g| is " + detail::number_text(usual, 3) +
        " times the sensors' noise (median), expected less than " +
        detail::number_text(kMistaken, 3) +
        (others.empty() ? "" : "; it contradicts " + others + ", which leave its bodies no room") +
        "; correct its parameters, or free one of them");
  }
}

}  // namespace diffnea
