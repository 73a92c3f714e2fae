#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/core/softplus.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/identify/constrained_loss.hpp>

#include "core/decompositions.hpp"
#include "core/statistics.hpp"
#include "identify/descent.hpp"

namespace diffnea {
namespace {

/// Root mean square of a sample's residuals, over the usual one, from which Huber's loss is linear.
constexpr double kHuber = 3.0;
/// Multiplier over its standard error from which the motion shows a force: noise alone does once in
/// 3e4 samples.
constexpr double kShown = 4.0;
/// Median of |g| over its noise from which a constraint that no parameter moves is a mistake.
constexpr double kMistaken = 10.0;
/// Change of the cost by weights of the present point, relative, below which they have settled: a
/// tenth of what one of a hundred samples counts.
constexpr double kSettled = 1e-3;
/// Eigenvalue of the curvature, columns of length 1, over the largest, that counts as 0: the square
/// of what rounding leaves of derivatives through ill-conditioned forces.
constexpr double kUnseen = 1e-12;
/// Square of a parameter's share in what is not seen, from which it is not known itself.
constexpr double kPartOfUnseen = 1e-6;
constexpr std::size_t kSamplesPerParameter = 10;  ///< at least
/// Numbers of a body's motion: place and turn, three each, and their two derivatives.
constexpr int kPerBody = 18;

/// How a sample enters the cost, taken at one point and then kept.
struct Weighing {
  bool counts = true;      ///< smoothed within one motion
  std::vector<bool> acts;  ///< per row
};
using Weighings = std::vector<Weighing>;

/// Standard deviation of a row's derivative of order d, of those of its bodies. Parameters move it:
/// a distance over its noise is one in the space of what was measured, as of total least squares.
template <class T>
T row_noise(const ConstraintRow<T>& row, const std::vector<BodyNoise>& noise, std::size_t d) {
  using std::sqrt;
  T square(0.0);
  for (std::size_t s = 0; s < kMostBodies; ++s) {
    if (row.bodies[s] == kWorld) continue;
    const BodyNoise& of = noise[static_cast<std::size_t>(row.bodies[s])];
    square = square + dot(row.J[s].torque, row.J[s].torque) * T(of.angle[d] * of.angle[d]) +
             dot(row.J[s].force, row.J[s].force) * T(of.position[d] * of.position[d]);
  }
  return sqrt(square);
}

template <class T>
T along(const ConstraintRow<T>& row, const std::vector<Twist<T>>& V) {
  T sum(0.0);
  for (std::size_t s = 0; s < kMostBodies; ++s)
    if (row.bodies[s] != kWorld) sum = sum + dot(V[row.bodies[s]], row.J[s]);
  return sum;
}

template <class T>
ConstrainedAcceleration<T> predicted(const ConstrainedSystem<T>& s,
                                     const std::vector<ConstraintRow<T>>& rows) {
  return held_acceleration<T>(s.bodies, s.states, s.applied, s.accelerations, rows, s.gravity);
}

/// Residuals of a sample over their noise.
template <class T>
std::vector<T> residuals(const ConstrainedSystem<T>& system, const std::vector<BodyNoise>& noise,
                         const Weighing& weighing, const std::array<double, 3>& lambda) {
  std::vector<T> out;
  const auto put = [&out](const T& x, double weight) { out.push_back(x * T(weight)); };
  const auto put_three = [&put](const Vec3<T>& x, double weight) {
    put(x.x, weight), put(x.y, weight), put(x.z, weight);
  };
  std::vector<ConstraintRow<T>> acting;
  for (std::size_t i = 0; i < system.rows.size(); ++i)
    if (weighing.acts[i]) acting.push_back(system.rows[i]);
  const std::vector<Twist<T>> model = predicted(system, acting).Vd;
  for (std::size_t b = 0; b < model.size(); ++b) {
    const BodyKind kind = system.bodies[b].kind;
    if (kind == BodyKind::kPrescribed) continue;
    put_three(system.accelerations[b].linear - model[b].linear, 1.0 / noise[b].position[2]);
    if (kind == BodyKind::kRigid)
      put_three(system.accelerations[b].angular - model[b].angular, 1.0 / noise[b].angle[2]);
  }
  for (std::size_t i = 0; i < system.rows.size(); ++i) {
    const ConstraintRow<T>& row = system.rows[i];
    const auto over_noise = [&](const T& x, std::size_t order) {
      put(x / row_noise(row, noise, order), std::sqrt(lambda[order]));
    };
    if (!weighing.acts[i]) {  // softplus leaves half of the noise at g = 0
      const double sharp = 2.0 * std::log(2.0);
      put(softplus((row.g / row_noise(row, noise, 0)) * T(sharp)), std::sqrt(lambda[0]) / sharp);
      continue;
    }
    over_noise(row.g, row.of_velocity ? 1 : 0);
    if (!row.of_velocity) over_noise(row.gd, 1);
    over_noise(along(row, system.accelerations) + row.bias, 2);
  }
  return out;
}

/// Jets by a share of the parameters. @param first  the first of them
VecX<JetD> seeded(const VecX<double>& p, Eigen::Index first) {
  VecX<JetD> out(p.size());
  for (Eigen::Index k = 0; k < p.size(); ++k)
    out[k] =
        k >= first && k < first + kJetWidth ? JetD(p[k], static_cast<int>(k - first)) : JetD(p[k]);
  return out;
}

/// The descent, and what it is fitted to.
class ConstrainedDescent {
 public:
  ConstrainedDescent(const ConstrainedModel& model,
                     const std::vector<ConstrainedParameter>& parameters, const BodyMotion& motion,
                     const ConstrainedFitOptions& options)
      : model_(model), parameters_(parameters), motion_(motion), options_(options) {
    p_.resize(static_cast<Eigen::Index>(parameters.size()));
    for (Eigen::Index k = 0; k < p_.size(); ++k) p_[k] = parameters[k].value;
    weighings_ = weighings_at(p_);
    require_agreement();
    set_usual();
    now_ = cost_at(p_, weighings_);
  }

  /// Steps, for descend().
  ///@{
  double cost() const { return now_; }
  void linearise();
  double attempt(double damping);
  void accept() {
    p_ = tried_;
    now_ = then_;
  }
  void refuse() {}
  bool stopped() const { return false; }
  bool settled() {
    there_ = weighings_at(p_);
    return std::abs(cost_at(p_, there_) - now_) <= kSettled * now_;
  }
  void reweigh() {
    weighings_ = there_;
    set_usual();
    now_ = cost_at(p_, weighings_);
  }
  ///@}

  const VecX<double>& p() const { return p_; }
  long counting() const {
    return std::ranges::count_if(weighings_, [](const Weighing& w) { return w.counts; });
  }
  MatX<double> covariance() const;  ///< at the last linearisation
  std::vector<ConstraintError> errors() const;

 private:
  Weighings weighings_at(const VecX<double>& p) const;
  std::vector<bool> shown_at(const ConstrainedSystem<double>& system) const;
  void leave_out_changes(Weighings& weighings) const;
  void require_agreement() const;
  std::string others_with(const ConstrainedSystem<double>& system, std::size_t row) const;
  void set_usual();
  MatX<double> score_by_motion(std::size_t k, std::size_t body) const;
  std::vector<double> residuals_at(const VecX<double>& p, std::size_t k,
                                   const Weighing& weighing) const {
    return residuals(model_.at(motion_.samples[k], p), motion_.noise, weighing, options_.lambda);
  }
  double cost_at(const VecX<double>& p, const Weighings& weighings) const;
  /// Huber's weight of a sample.
  double weight(double squared, std::size_t count) const {
    const double u = std::sqrt(squared / static_cast<double>(count)), most = kHuber * usual_;
    return !options_.robust || u <= most ? 1.0 : most / u;
  }

  const ConstrainedModel& model_;
  const std::vector<ConstrainedParameter>& parameters_;
  const BodyMotion& motion_;
  const ConstrainedFitOptions& options_;
  Weighings weighings_, there_;  ///< in use, and of the present point
  double usual_ = 1.0;           ///< root mean square of the median sample's residuals
  VecX<double> p_, tried_, g_;
  MatX<double> H_;                      ///< (P, P) Jᵀ W J
  std::vector<MatX<double>> weighted_;  ///< W J of each sample
  double now_ = 0.0, then_ = 0.0;
};

/// Rows whose force the measured accelerations show: least squares of V̇₀ − V̇ = M̄⁻¹ Jᵀ λ.
std::vector<bool> ConstrainedDescent::shown_at(const ConstrainedSystem<double>& system) const {
  const auto m = static_cast<Eigen::Index>(system.rows.size());
  const std::vector<Twist<double>> without = predicted(system, {}).Vd;
  const auto n = static_cast<Eigen::Index>(6 * without.size());
  MatX<double> B = MatX<double>::Zero(n, m);
  VecX<double> r = VecX<double>::Zero(n);
  for (std::size_t b = 0; b < without.size(); ++b) {
    if (system.bodies[b].kind == BodyKind::kPrescribed) continue;
    const bool turns = system.bodies[b].kind == BodyKind::kRigid;
    const double per_angle = turns ? 1.0 / motion_.noise[b].angle[2] : 0.0,
                 per_length = 1.0 / motion_.noise[b].position[2];
    const Mobility<double> mobility(system.bodies[b]);
    const auto six = [&](const Twist<double>& V) {
      Eigen::Matrix<double, 6, 1> out;
      out << to_eigen(V.angular) * per_angle, to_eigen(V.linear) * per_length;
      return out;
    };
    const auto at = static_cast<Eigen::Index>(6 * b);
    r.segment<6>(at) = six(without[b] + system.accelerations[b] * -1.0);
    for (Eigen::Index i = 0; i < m; ++i)
      for (std::size_t s = 0; s < kMostBodies; ++s)
        if (system.rows[i].bodies[s] == static_cast<int>(b))
          B.block<6, 1>(at, i) += six(mobility * system.rows[i].J[s]);
  }
  const Eigen::CompleteOrthogonalDecomposition<MatX<double>> qr(B);
  const MatX<double> inverse = pseudo_inverse(qr);
  std::vector<bool> out(static_cast<std::size_t>(m));
  for (Eigen::Index i = 0; i < m; ++i)
    out[static_cast<std::size_t>(i)] = inverse.row(i).dot(r) > kShown * inverse.row(i).norm();
  return out;
}

Weighings ConstrainedDescent::weighings_at(const VecX<double>& p) const {
  Weighings out;
  bool changes = false;
  for (const BodySample& sample : motion_.samples) {
    const ConstrainedSystem<double> system = model_.at(sample, p);
    if (!out.empty() && system.rows.size() != out.front().acts.size())
      throw ShapeError("constrained loss: the system at " + detail::number_text(sample.time) +
                       " s has " + std::to_string(system.rows.size()) +
                       " rows of constraints, expected " + std::to_string(out.front().acts.size()) +
                       " as at the first sample");
    Weighing w;
    const bool one_sided = std::ranges::any_of(
        system.rows, [](const auto& row) { return row.relation == Relation::kAtMost; });
    const std::vector<bool> shown = one_sided ? shown_at(system) : std::vector<bool>();
    for (std::size_t i = 0; i < system.rows.size(); ++i) {
      const ConstraintRow<double>& row = system.rows[i];
      w.acts.push_back(row.relation == Relation::kEqual || shown[i]);
      changes = changes || row.relation == Relation::kAtMost;
      if (!(row_noise(row, motion_.noise, 0) > 0.0 && row_noise(row, motion_.noise, 1) > 0.0 &&
            row_noise(row, motion_.noise, 2) > 0.0))
        throw DataError("constrained loss: constraint '" + row.name + "' at " +
                        detail::number_text(sample.time) +
                        " s: the noise of its bodies leaves it none; give BodyMotion::noise of a "
                        "body that it moves");
    }
    out.push_back(std::move(w));
  }
  if (changes) leave_out_changes(out);
  return out;
}

/// Leaves out samples with another choice of acting rows within their smoothing.
void ConstrainedDescent::leave_out_changes(Weighings& weighings) const {
  const auto n = static_cast<long>(weighings.size());
  std::vector<long> since(weighings.size(), 0);  // first sample of the same choice
  for (long k = 1; k < n; ++k)
    since[k] = motion_.samples[k].stretch == motion_.samples[k - 1].stretch &&
                       weighings[k].acts == weighings[k - 1].acts
                   ? since[k - 1]
                   : k;
  for (long k = 0; k < n; ++k) {
    const int stretch = motion_.samples[k].stretch;
    long first = k, last = k;
    while (first > 0 && k - first < motion_.half_width &&
           motion_.samples[first - 1].stretch == stretch)
      --first;
    while (last + 1 < n && last - k < motion_.half_width &&
           motion_.samples[last + 1].stretch == stretch)
      ++last;
    weighings[k].counts = since[last] <= first;
  }
}

/// Names of the constraints in whose span a row of equalities is.
std::string ConstrainedDescent::others_with(const ConstrainedSystem<double>& system,
                                            std::size_t row) const {
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

/// @throws DataError if a constraint that no parameter moves does not hold
void ConstrainedDescent::require_agreement() const {
  const ConstrainedSystem<double> first = model_.at(motion_.samples.front(), p_);
  std::vector<bool> moves(first.rows.size(), false);
  for (Eigen::Index begin = 0; begin < p_.size(); begin += kJetWidth) {
    const ConstrainedSystem<JetD> system = model_.at(motion_.samples.front(), seeded(p_, begin));
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
    for (const BodySample& sample : motion_.samples) {
      const ConstraintRow<double> there = model_.at(sample, p_).rows[i];
      off.push_back(std::abs(there.g) / row_noise(there, motion_.noise, order));
    }
    const double usual = median(off);
    if (!(usual > kMistaken)) continue;
    const std::string others = others_with(first, i);
    double reach = 0.0;  // change of g by a metre of its bodies
    for (const Wrench<double>& J : row.J) reach = std::max(reach, std::sqrt(dot(J.force, J.force)));
    throw DataError(
        "constrained loss: constraint '" + row.name +
        "' has no free parameter and does not hold: " + "at the first sample, " +
        detail::number_text(motion_.samples.front().time) + " s, its g is " +
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

void ConstrainedDescent::set_usual() {
  std::vector<double> each;
  for (std::size_t k = 0; k < weighings_.size(); ++k) {
    if (!weighings_[k].counts) continue;
    const std::vector<double> e = residuals_at(p_, k, weighings_[k]);
    each.push_back(Eigen::Map<const VecX<double>>(e.data(), static_cast<long>(e.size())).norm() /
                   std::sqrt(static_cast<double>(e.size())));
  }
  if (each.size() < kSamplesPerParameter * parameters_.size())
    throw DataError("constrained loss: " + std::to_string(each.size()) +
                    " samples are left that are smoothed within one motion, expected at least " +
                    std::to_string(kSamplesPerParameter * parameters_.size()) + " for " +
                    std::to_string(parameters_.size()) + " parameters; record for longer");
  usual_ = std::max(1.0, median(each));
}

double ConstrainedDescent::cost_at(const VecX<double>& p, const Weighings& weighings) const {
  double sum = 0.0;
  for (std::size_t k = 0; k < weighings.size(); ++k) {
    if (!weighings[k].counts) continue;
    const std::vector<double> e = residuals_at(p, k, weighings[k]);
    double squared = 0.0;
    for (const double x : e) squared += x * x;
    const double w = weight(squared, e.size());
    sum += w * (2.0 - w) * squared;
  }
  return sum;
}

void ConstrainedDescent::linearise() {
  const Eigen::Index P = p_.size();
  H_ = MatX<double>::Zero(P, P);
  g_ = VecX<double>::Zero(P);
  weighted_.assign(weighings_.size(), {});
  for (std::size_t k = 0; k < weighings_.size(); ++k) {
    if (!weighings_[k].counts) continue;
    MatX<double> J;
    VecX<double> e;
    for (Eigen::Index begin = 0; begin < P; begin += kJetWidth) {
      const std::vector<JetD> r = residuals(model_.at(motion_.samples[k], seeded(p_, begin)),
                                            motion_.noise, weighings_[k], options_.lambda);
      const auto rows = static_cast<Eigen::Index>(r.size());
      const Eigen::Index width = std::min<Eigen::Index>(kJetWidth, P - begin);
      J.conservativeResize(rows, P);
      e.resize(rows);
      for (Eigen::Index i = 0; i < rows; ++i) {
        e[i] = r[static_cast<std::size_t>(i)].a;
        J.row(i).segment(begin, width) = r[static_cast<std::size_t>(i)].v.head(width).transpose();
      }
    }
    const double w = weight(e.squaredNorm(), static_cast<std::size_t>(e.size()));
    H_ += w * J.transpose() * J;
    g_ += w * J.transpose() * e;
    weighted_[k] = w * J;
  }
}

double ConstrainedDescent::attempt(double damping) {
  MatX<double> damped = H_;
  damped.diagonal() *= 1.0 + damping;
  damped.diagonal().array() += std::numeric_limits<double>::min();  // for what nothing depends on
  const VecX<double> step = Eigen::LDLT<MatX<double>>(damped).solve(VecX<double>(-g_));
  tried_ = p_ + step;
  for (Eigen::Index k = 0; k < p_.size(); ++k) {
    const Sign sign = parameters_[static_cast<std::size_t>(k)].sign;
    if (sign == Sign::kPositive) tried_[k] = std::max(tried_[k], 0.1 * p_[k]);
    if (sign == Sign::kNonNegative) tried_[k] = std::max(tried_[k], 0.0);
  }
  return then_ = cost_at(tried_, weighings_);
}

/// Jᵀ W e by the 18 numbers that a body's state and acceleration were smoothed to.
MatX<double> ConstrainedDescent::score_by_motion(std::size_t k, std::size_t body) const {
  MatX<double> out = MatX<double>::Zero(p_.size(), kPerBody);
  const int numbers = motion_.noise[body].angle[0] > 0.0 ? kPerBody : kPerBody / 2;
  for (int first = 0; first < numbers; first += kJetWidth) {
    const std::vector<JetD> e = residuals(
        model_.at(motion_.samples[k], seeded(p_, p_.size()), {static_cast<int>(body), first}),
        motion_.noise, weighings_[k], options_.lambda);
    for (int c = first; c < std::min(first + kJetWidth, numbers); ++c) {
      VecX<double> slope(static_cast<Eigen::Index>(e.size()));
      for (Eigen::Index i = 0; i < slope.size(); ++i) slope[i] = e[i].v[c - first];
      out.col(c) = weighted_[k].transpose() * slope;
    }
  }
  return out;
}

/// H⁻¹ S H⁻¹, S the covariance of the score: what the noise of each row of the sensors makes of it,
/// through all samples that it was smoothed into.
MatX<double> ConstrainedDescent::covariance() const {
  const Eigen::Index P = p_.size();
  MatX<double> S = MatX<double>::Zero(P, P);
  std::vector<MatX<double>> of_rows;  // (P, 6 a body) score by a row's turn and place
  const auto bodies = static_cast<Eigen::Index>(motion_.noise.size());
  for (std::size_t k = 0; k < weighings_.size(); ++k) {
    if (!weighings_[k].counts) continue;
    const BodySample& sample = motion_.samples[k];
    for (Eigen::Index b = 0; b < bodies; ++b) {
      const BodyNoise& noise = motion_.noise[static_cast<std::size_t>(b)];
      if (!(noise.position[0] > 0.0 || noise.angle[0] > 0.0)) continue;
      MatX<double> score = score_by_motion(k, static_cast<std::size_t>(b));
      const Eigen::Matrix3d to_body =
          to_eigen(sample.states[static_cast<std::size_t>(b)].X_WB.R).transpose();
      for (Eigen::Index c = 0; c < kPerBody; c += 3)  // rows of neighbours share the world's axes
        score.middleCols(c, 3) = (score.middleCols(c, 3) * to_body).eval();
      for (std::size_t i = 0; i < sample.weights.size(); ++i) {
        const std::size_t row = static_cast<std::size_t>(sample.first_row) + i;
        if (row >= of_rows.size()) of_rows.resize(row + 1, MatX<double>::Zero(P, 6 * bodies));
        for (Eigen::Index d = 0; d < 3; ++d) {
          const double c = sample.weights[i][static_cast<std::size_t>(d)];
          of_rows[row].middleCols(6 * b, 3) += c * noise.row_angle * score.middleCols(9 + 3 * d, 3);
          of_rows[row].middleCols(6 * b + 3, 3) +=
              c * noise.row_position * score.middleCols(3 * d, 3);
        }
      }
      if (!sample.weights.empty()) continue;
      for (Eigen::Index d = 0; d < 3; ++d) {
        const auto order = static_cast<std::size_t>(d);
        const MatX<double> turn = noise.angle[order] * score.middleCols(9 + 3 * d, 3),
                           place = noise.position[order] * score.middleCols(3 * d, 3);
        S += turn * turn.transpose() + place * place.transpose();
      }
    }
  }
  for (const MatX<double>& row : of_rows) S += row * row.transpose();
  S *= usual_ * usual_;
  VecX<double> size = H_.diagonal().cwiseSqrt();
  for (double& x : size)
    if (!(x > 0.0)) x = 1.0;
  const VecX<double> per = size.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(
      MatX<double>(per.asDiagonal() * H_ * per.asDiagonal()));
  const VecX<double>& l = eigen.eigenvalues();
  const MatX<double>& V = eigen.eigenvectors();
  VecX<double> inverse(P), unseen = VecX<double>::Zero(P);
  for (Eigen::Index k = 0; k < P; ++k) {
    const bool seen = l[k] > kUnseen * l[P - 1] && l[P - 1] > 0.0;
    inverse[k] = seen ? 1.0 / l[k] : 0.0;
    if (!seen) unseen += V.col(k).cwiseAbs2();
  }
  const MatX<double> G =
      per.asDiagonal() * V * inverse.asDiagonal() * V.transpose() * per.asDiagonal();
  MatX<double> out = G * S * G;
  for (Eigen::Index k = 0; k < P; ++k)
    if (unseen[k] > kPartOfUnseen) out(k, k) = std::numeric_limits<double>::infinity();
  return out;
}

std::vector<ConstraintError> ConstrainedDescent::errors() const {
  std::vector<ConstraintError> out;
  std::vector<long> counts;
  for (std::size_t k = 0; k < weighings_.size(); ++k) {
    const Weighing& w = weighings_[k];
    if (!w.counts) continue;
    const std::vector<ConstraintRow<double>> rows = model_.at(motion_.samples[k], p_).rows;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      auto at = std::ranges::find(out, rows[i].name, &ConstraintError::name);
      if (at == out.end()) {
        out.push_back({rows[i].name, 0.0, 0.0});
        counts.push_back(0);
        at = out.end() - 1;
      }
      if (!w.acts[i]) continue;
      const double over =
          rows[i].g / row_noise(rows[i], motion_.noise, rows[i].of_velocity ? 1 : 0);
      at->g += rows[i].g * rows[i].g;
      at->over_noise += over * over;
      ++counts[static_cast<std::size_t>(at - out.begin())];
    }
  }
  for (std::size_t c = 0; c < out.size(); ++c) {
    const auto n = static_cast<double>(std::max(1L, counts[c]));
    out[c].g = std::sqrt(out[c].g / n);
    out[c].over_noise = std::sqrt(out[c].over_noise / n);
  }
  return out;
}

/// The motion of a body with its smoothed turn and place, and their two derivatives, as variables:
/// numbers `first` and on of kPerBody. Places are in the body's smoothed axes.
void vary(BodyState<JetD>& state, Twist<JetD>& acceleration, int first) {
  const auto variable = [first](int at) {
    const auto one = [&](int k) {
      return k >= first && k < first + kJetWidth ? JetD(0.0, k - first) : JetD(0.0);
    };
    return Vec3<JetD>{one(at), one(at + 1), one(at + 2)};
  };
  const Vec3<JetD> spin = state.V.angular, v = state.V.linear,
                   a = acceleration.linear + cross(spin, v);
  const Mat3<JetD> turn = exp(variable(9));
  state.X_WB.p = state.X_WB.p + state.X_WB.R * variable(0);
  state.X_WB.R = state.X_WB.R * turn;
  state.V.angular = spin + variable(12);
  state.V.linear = transpose_times(turn, v + variable(3));
  acceleration.angular = acceleration.angular + variable(15);
  acceleration.linear =
      transpose_times(turn, a + variable(6)) - cross(state.V.angular, state.V.linear);
}

template <class T>
ConstrainedSystem<T> system_at(
    const std::function<void(const BodySample&, const VecX<T>&, ConstrainedSystem<T>&)>& fill,
    const BodySample& sample, const VecX<T>& p, const MotionVariables& variables) {
  ConstrainedSystem<T> out;
  for (const BodyState<double>& s : sample.states)
    out.states.push_back({s.X_WB.template cast<T>(),
                          {s.V.angular.template cast<T>(), s.V.linear.template cast<T>()}});
  for (const Twist<double>& a : sample.accelerations)
    out.accelerations.push_back({a.angular.template cast<T>(), a.linear.template cast<T>()});
  if constexpr (std::is_same_v<T, JetD>)
    if (variables.body >= 0)
      vary(out.states[static_cast<std::size_t>(variables.body)],
           out.accelerations[static_cast<std::size_t>(variables.body)], variables.first);
  const Vec3<T> zero{T(0.0), T(0.0), T(0.0)};
  out.applied.assign(sample.states.size(), {zero, zero});
  fill(sample, p, out);
  require_size("constrained loss: bodies of the system", static_cast<long>(out.bodies.size()),
               static_cast<long>(sample.states.size()), "body of the motion");
  return out;
}

/// @throws DataError, ShapeError
void check_motion(const ConstrainedModel& model,
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
  VecX<double> p(static_cast<Eigen::Index>(parameters.size()));
  for (Eigen::Index k = 0; k < p.size(); ++k) p[k] = parameters[k].value;
  const ConstrainedSystem<double> first = model.at(motion.samples.front(), p);
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

}  // namespace

ConstrainedSystem<double> ConstrainedModel::at(const BodySample& sample,
                                               const VecX<double>& p) const {
  return system_at(plain_, sample, p, {});
}
ConstrainedSystem<JetD> ConstrainedModel::at(const BodySample& sample, const VecX<JetD>& p,
                                             const MotionVariables& variables) const {
  return system_at(jets_, sample, p, variables);
}

ConstrainedFit fit_constrained(const ConstrainedModel& model,
                               const std::vector<ConstrainedParameter>& parameters,
                               const BodyMotion& motion, const ConstrainedFitOptions& options) {
  check_motion(model, parameters, motion);
  ConstrainedDescent descent(model, parameters, motion, options);
  ConstrainedFit out;
  const DescentEnd end =
      descend(descent, {options.max_iterations, options.tolerance}, out.iterations);
  out.converged = end != DescentEnd::kLimit;
  out.termination = end == DescentEnd::kLimit    ? "the largest number of iterations is reached"
                    : end == DescentEnd::kNoStep ? "no step makes it better"
                                                 : "the last step gained less than the tolerance";
  descent.linearise();
  out.p = descent.p();
  out.covariance = descent.covariance();
  out.chi2 = descent.cost();
  out.samples = descent.counting();
  out.constraints = descent.errors();
  return out;
}

}  // namespace diffnea
