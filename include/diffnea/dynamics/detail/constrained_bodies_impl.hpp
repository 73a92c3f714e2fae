#pragma once

#include <algorithm>
#include <optional>

#include <Eigen/Cholesky>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/constrained_bodies.hpp>

namespace diffnea::detail {

/// What a row's own diagonal may shrink to, by those before it, and still be its own.
inline constexpr double kDependent = 1e-10;
/// What a row that others imply may differ from what they imply, of the largest demand, or of 1 in
/// its unit over s² where all demands are small: more than the drift of a simulation leaves, less
/// than any contradiction.
inline constexpr double kContradiction = 1e-4;

/// Share of a row's own diagonal that lets redundant rows be solved for: forces are off by as much,
/// and rounding is 1e-16 over it.
inline constexpr double kRidge = 1e-8;

/// A λ = b on the rows `chosen`, redundant ones left out: pivoted Cholesky on the values chooses,
/// the same elimination on T solves.
template <class T>
std::vector<T> solve_rows(const MatX<T>& A, const VecX<T>& b, std::vector<int> chosen,
                          std::vector<int>& redundant) {
  const auto n = static_cast<int>(chosen.size());
  MatX<T> L(n, n);  // of the permuted, shrinking matrix
  std::vector<T> diagonal(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) diagonal[i] = A(chosen[i], chosen[i]);
  int rank = 0;
  for (; rank < n; ++rank) {
    int pivot = rank;
    for (int i = rank + 1; i < n; ++i)
      if (value(diagonal[i]) / std::max(value(A(chosen[i], chosen[i])), 1e-300) >
          value(diagonal[pivot]) / std::max(value(A(chosen[pivot], chosen[pivot])), 1e-300))
        pivot = i;
    if (!(value(diagonal[pivot]) > kDependent * value(A(chosen[pivot], chosen[pivot])))) break;
    std::swap(chosen[rank], chosen[pivot]);
    std::swap(diagonal[rank], diagonal[pivot]);
    for (int k = 0; k < rank; ++k) std::swap(L(rank, k), L(pivot, k));
    using std::sqrt;
    L(rank, rank) = sqrt(diagonal[rank]);
    for (int i = rank + 1; i < n; ++i) {
      T sum = A(chosen[i], chosen[rank]);
      for (int k = 0; k < rank; ++k) sum = sum - L(i, k) * L(rank, k);
      L(i, rank) = sum / L(rank, rank);
      diagonal[i] = diagonal[i] - L(i, rank) * L(i, rank);
    }
  }
  std::vector<T> lambda(static_cast<std::size_t>(A.rows()), T(0.0));
  VecX<T> y(rank);
  for (int i = 0; i < rank; ++i) {
    T sum = b[chosen[i]];
    for (int k = 0; k < i; ++k) sum = sum - L(i, k) * y[k];
    y[i] = sum / L(i, i);
  }
  for (int i = rank - 1; i >= 0; --i) {
    T sum = y[i];
    for (int k = i + 1; k < rank; ++k) sum = sum - L(k, i) * lambda[chosen[k]];
    lambda[chosen[i]] = sum / L(i, i);
  }
  redundant.assign(chosen.begin() + rank, chosen.end());
  return lambda;
}

/// λ, or what keeps the rows from agreeing.
template <class T>
struct Complementary {
  std::vector<T> multiplier;
  std::string contradiction;  ///< empty where there is none
};

/// Equalities hold, inequalities among the candidates are complementary.
template <class T>
Complementary<T> try_complementary(const MatX<T>& A, const VecX<T>& b,
                                   const std::vector<ConstraintRow<T>>& rows,
                                   const std::vector<int>& candidates) {
  double scale = 0.0;
  for (const int i : candidates) scale = std::max(scale, std::abs(value(b[i])));
  const auto demanded = [&](const std::vector<T>& lambda, int i) {
    double sum = -value(b[i]);
    for (int k = 0; k < A.cols(); ++k) sum += value(A(i, k)) * value(lambda[k]);
    return sum;  // (A λ − b)_i: how far below its bound the row stays
  };
  std::vector<bool> active(rows.size(), false);
  for (const int i : candidates) active[i] = true;
  // Murty's rule changes the row of least index alone, which ends for any positive definite A.
  const int most = 1 << std::min<int>(20, static_cast<int>(candidates.size()) + 3);
  for (int round = 0; round < most; ++round) {
    std::vector<int> chosen, redundant;
    for (const int i : candidates)
      if (active[i]) chosen.push_back(i);
    const std::vector<T> lambda = solve_rows(A, b, chosen, redundant);
    for (const int i : redundant) {
      if (rows[i].relation == Relation::kAtMost) continue;  // judged below
      if (std::abs(demanded(lambda, i)) > kContradiction * std::max(scale, 1.0))
        return {{},
                "constrained bodies: constraint '" + rows[i].name +
                    "' contradicts the others: they leave it no motion, and it demands one; "
                    "remove it, or start from a state that satisfies all of them"};
    }
    int wrong = -1;
    for (const int i : candidates) {
      if (rows[i].relation == Relation::kEqual) continue;
      const bool implied = std::find(redundant.begin(), redundant.end(), i) != redundant.end();
      const bool bad = active[i] && !implied
                           ? value(lambda[i]) < 0.0
                           : demanded(lambda, i) < -1e-9 * std::max(scale, 1e-300);
      if (bad) {
        wrong = i;
        break;
      }
    }
    if (wrong < 0) return {lambda, {}};
    active[wrong] = !active[wrong];
  }
  return {{},
          "constrained bodies: no choice of tight inequalities is consistent; first: '" +
              rows[candidates.front()].name + "'"};
}

/// @throws ModelError if rows contradict each other, naming the constraints without which the
///         others agree
template <class T>
std::vector<T> solve_complementary(const MatX<T>& A, const VecX<T>& b,
                                   const std::vector<ConstraintRow<T>>& rows,
                                   const std::vector<int>& candidates) {
  Complementary<T> found = try_complementary(A, b, rows, candidates);
  if (found.contradiction.empty()) return std::move(found.multiplier);
  std::vector<std::string> tried;
  std::string names;
  for (const int i : candidates) {
    const std::string& name = rows[i].name;
    if (std::find(tried.begin(), tried.end(), name) != tried.end()) continue;
    tried.push_back(name);
    std::vector<int> others;
    for (const int k : candidates)
      if (rows[k].name != name) others.push_back(k);
    if (try_complementary(A, b, rows, others).contradiction.empty())
      names += (names.empty() ? "'" : " or '") + name + "'";
  }
  throw ModelError(found.contradiction +
                   (names.empty() ? "" : "; the others agree without " + names));
}

template <class T>
MatX<T> coupling(const std::vector<Mobility<T>>& mobility,
                 const std::vector<ConstraintRow<T>>& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  MatX<T> A = MatX<T>::Constant(n, n, T(0.0));
  for (Eigen::Index i = 0; i < n; ++i)
    for (std::size_t s = 0; s < kMostBodies; ++s) {
      const int body = rows[i].bodies[s];
      if (body == kWorld) continue;
      const Twist<T> response = mobility[body] * rows[i].J[s];
      for (Eigen::Index j = 0; j <= i; ++j)
        for (std::size_t t = 0; t < kMostBodies; ++t)
          if (rows[j].bodies[t] == body) A(i, j) = A(i, j) + dot(response, rows[j].J[t]);
    }
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = i + 1; j < n; ++j) A(i, j) = A(j, i);
  return A;
}

/// J V over the bodies of a row.
template <class T>
T along(const ConstraintRow<T>& row, const std::vector<Twist<T>>& V) {
  T sum(0.0);
  for (std::size_t s = 0; s < kMostBodies; ++s)
    if (row.bodies[s] != kWorld) sum = sum + dot(V[row.bodies[s]], row.J[s]);
  return sum;
}

/// g̈*, or ġ* of velocities; none where an inequality is not tight.
template <class T>
std::optional<T> target_of(const ConstraintRow<T>& row, const Stabilisation& stabilisation) {
  const T target = row.of_velocity ? row.g * T(-stabilisation.kd)
                                   : row.g * T(-stabilisation.kp) + row.gd * T(-stabilisation.kd);
  if (row.relation == Relation::kEqual) return target;
  if (value(row.g) < -kTouching) return std::nullopt;
  return value(target) > 0.0 ? T(0.0) : target;
}

template <class T>
void check_rows(const std::vector<ConstraintRow<T>>& rows, std::size_t bodies) {
  for (const ConstraintRow<T>& row : rows)
    for (const int b : row.bodies)
      if (b < kWorld || b >= static_cast<int>(bodies))
        throw ShapeError("constrained bodies: constraint '" + row.name + "' names body " +
                         std::to_string(b) + " of " + std::to_string(bodies));
}

template <class T>
std::vector<Mobility<T>> mobilities(const std::vector<FreeBody<T>>& bodies) {
  for (std::size_t b = 0; b < bodies.size(); ++b)
    if (bodies[b].kind != BodyKind::kPrescribed && !(value(bodies[b].inertia.m) > 0.0))
      throw ModelError("constrained bodies: body " + std::to_string(b) + " has a mass of " +
                       std::to_string(value(bodies[b].inertia.m)) +
                       " kg, expected a positive one (or a prescribed body)");
  return {bodies.begin(), bodies.end()};
}

/// V̇₀, and no force. @param where  for messages  @throws ShapeError
template <class T>
ConstrainedAcceleration<T> without_constraints(
    const char* where, const std::vector<FreeBody<T>>& bodies,
    const std::vector<Mobility<T>>& mobility, const std::vector<BodyState<T>>& states,
    const std::vector<Wrench<T>>& applied, const std::vector<Twist<T>>& prescribed,
    const std::vector<ConstraintRow<T>>& rows, const Vec3<T>& gravity) {
  const std::size_t n = bodies.size();
  const auto one_each = [&](const char* what, std::size_t size) {
    if (size != n)
      require_size((std::string(where) + ": " + what).c_str(), static_cast<long>(size),
                   static_cast<long>(n), "body");
  };
  one_each("states", states.size());
  one_each("applied", applied.size());
  if (!prescribed.empty()) one_each("prescribed", prescribed.size());
  check_rows(rows, n);

  ConstrainedAcceleration<T> out;
  out.Vd.resize(n);
  const Vec3<T> zero{T(0.0), T(0.0), T(0.0)};
  out.force.assign(n, {zero, zero});
  for (std::size_t b = 0; b < n; ++b) {
    if (bodies[b].kind == BodyKind::kPrescribed) {
      out.Vd[b] = prescribed.empty() ? Twist<T>{zero, zero} : prescribed[b];
      continue;
    }
    Wrench<T> net = applied[b] + weight(bodies[b], states[b].X_WB, gravity);
    if (bodies[b].kind == BodyKind::kRigid)
      net = net - minus_ad_star(states[b].V, bodies[b].inertia * states[b].V);
    out.Vd[b] = mobility[b] * net;
  }
  out.multiplier.assign(rows.size(), T(0.0));
  return out;
}

/// Adds the forces −Jᵀλ and what they do.
template <class T>
void add_forces(const std::vector<Mobility<T>>& mobility, const std::vector<ConstraintRow<T>>& rows,
                ConstrainedAcceleration<T>& out) {
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t s = 0; s < kMostBodies; ++s)
      if (const int body = rows[i].bodies[s]; body != kWorld)
        out.force[body] = out.force[body] - rows[i].J[s] * out.multiplier[i];
  for (std::size_t b = 0; b < out.Vd.size(); ++b)
    out.Vd[b] = out.Vd[b] + mobility[b] * out.force[b];
}

}  // namespace diffnea::detail

namespace diffnea {

template <Scalar T>
ConstrainedAcceleration<T> constrained_acceleration(const std::vector<FreeBody<T>>& bodies,
                                                    const std::vector<BodyState<T>>& states,
                                                    const std::vector<Wrench<T>>& applied,
                                                    const std::vector<Twist<T>>& prescribed,
                                                    const std::vector<ConstraintRow<T>>& rows,
                                                    const Vec3<T>& gravity,
                                                    const Stabilisation& stabilisation) {
  const std::vector<Mobility<T>> mobility = detail::mobilities(bodies);
  ConstrainedAcceleration<T> out = detail::without_constraints(
      "constrained_acceleration", bodies, mobility, states, applied, prescribed, rows, gravity);
  const auto m = static_cast<Eigen::Index>(rows.size());
  VecX<T> demand(m);
  std::vector<int> candidates;
  for (Eigen::Index i = 0; i < m; ++i) {
    const ConstraintRow<T>& row = rows[i];
    const std::optional<T> target = detail::target_of(row, stabilisation);
    if (!target) continue;
    demand[i] = detail::along(row, out.Vd) + row.bias - *target;
    candidates.push_back(static_cast<int>(i));
  }
  if (candidates.empty()) return out;
  out.multiplier =
      detail::solve_complementary(detail::coupling(mobility, rows), demand, rows, candidates);
  detail::add_forces(mobility, rows, out);
  return out;
}

template <Scalar T>
ConstrainedAcceleration<T> held_acceleration(const std::vector<FreeBody<T>>& bodies,
                                             const std::vector<BodyState<T>>& states,
                                             const std::vector<Wrench<T>>& applied,
                                             const std::vector<Twist<T>>& prescribed,
                                             const std::vector<ConstraintRow<T>>& rows,
                                             const Vec3<T>& gravity) {
  const std::vector<Mobility<T>> mobility = detail::mobilities(bodies);
  ConstrainedAcceleration<T> out = detail::without_constraints(
      "held_acceleration", bodies, mobility, states, applied, prescribed, rows, gravity);
  const auto m = static_cast<Eigen::Index>(rows.size());
  if (m == 0) return out;
  MatX<T> A = detail::coupling(mobility, rows);
  VecX<T> demand(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    demand[i] = detail::along(rows[i], out.Vd) + rows[i].bias;
    // A row that moves nothing, between prescribed bodies, has no force.
    A(i, i) = value(A(i, i)) > 0.0 ? A(i, i) * T(1.0 + detail::kRidge) : T(1.0);
  }
  const VecX<T> lambda = Eigen::LLT<MatX<T>>(A).solve(demand);
  out.multiplier.assign(lambda.begin(), lambda.end());
  detail::add_forces(mobility, rows, out);
  return out;
}

template <Scalar T>
std::vector<Twist<T>> after_impact(const std::vector<FreeBody<T>>& bodies,
                                   const std::vector<BodyState<T>>& states,
                                   const std::vector<ConstraintRow<T>>& rows, double restitution) {
  require_size("after_impact: states", static_cast<long>(states.size()),
               static_cast<long>(bodies.size()), "body");
  detail::check_rows(rows, bodies.size());
  const std::vector<Mobility<T>> mobility = detail::mobilities(bodies);
  std::vector<Twist<T>> V;
  for (const BodyState<T>& s : states) V.push_back(s.V);
  VecX<T> demand(static_cast<Eigen::Index>(rows.size()));
  std::vector<int> candidates;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const ConstraintRow<T>& row = rows[i];
    if (row.relation == Relation::kAtMost && value(row.g) < -kTouching) continue;
    const T speed = row.of_velocity ? row.g : row.gd;
    const bool bounces = row.relation == Relation::kAtMost && value(speed) > 0.0;
    demand[static_cast<Eigen::Index>(i)] = bounces ? speed * T(1.0 + restitution) : speed;
    candidates.push_back(static_cast<int>(i));
  }
  if (candidates.empty()) return V;
  const std::vector<T> impulse =
      detail::solve_complementary(detail::coupling(mobility, rows), demand, rows, candidates);
  for (const int i : candidates)
    for (std::size_t s = 0; s < kMostBodies; ++s)
      if (const int body = rows[i].bodies[s]; body != kWorld)
        V[body] = V[body] + mobility[body] * (rows[i].J[s] * (T(0.0) - impulse[i]));
  return V;
}

}  // namespace diffnea
