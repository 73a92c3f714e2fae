/// The constrained loss for constraints of several kinds. Motions come from equations of their own
/// or from MuJoCo (support/measured_bodies.hpp).

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/constraints.hpp>
#include <diffnea/identify/constrained_loss.hpp>

#include "support/measured_bodies.hpp"

namespace constrained_loss_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr unsigned kSeeds = 20;
/// Share of estimates inside their 95 % intervals, at least: of 60 numbers fewer are once in 500,
/// were they independent.
constexpr double kLeastShare = 0.85;
/// Noiseless rows: cubics through seven of them leave 1e-6 of the accelerations.
constexpr double kExact = 1e-4;

template <class T>
Vec3<T> zero() {
  return {T(0.0), T(0.0), T(0.0)};
}

/// Estimates against the truth over seeds.
class Coverage {
 public:
  void add(const ConstrainedFit& fit, const std::vector<double>& truth) {
    for (std::size_t k = 0; k < truth.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      const double u = (fit.p[i] - truth[k]) / std::sqrt(fit.covariance(i, i));
      inside_ += std::abs(u) < 1.96 ? 1 : 0;
      ++all_;
      worst_ = std::max(worst_, std::abs(u));
    }
  }
  double share() const { return static_cast<double>(inside_) / all_; }
  double worst() const { return worst_; }

 private:
  int inside_ = 0, all_ = 0;
  double worst_ = 0.0;
};

/// Rods from the origin to the first particle, and to the second. p: lengths, second mass.
struct Rods {
  double first_mass;
  template <class T>
  void operator()(const BodySample&, const VecX<T>& p, ConstrainedSystem<T>& s) const {
    s.bodies = {particle(T(first_mass)), particle(p[2])};
    append_rows(Rod<T>{zero<T>(), zero<T>(), p[0]}, "upper", {kWorld, 0}, s.states, s.rows);
    append_rows(Rod<T>{zero<T>(), zero<T>(), p[1]}, "lower", {0, 1}, s.states, s.rows);
  }
};
const std::vector<ConstrainedParameter> kRods{{"upper.length", "m", 0.4, Sign::kPositive},
                                              {"lower.length", "m", 0.4, Sign::kPositive},
                                              {"lower.mass", "kg", 0.1, Sign::kPositive}};

/// p: radius, axial inertia.
struct Roller {
  double slope, mass;
  template <class T>
  void operator()(const BodySample& at, const VecX<T>& p, ConstrainedSystem<T>& s) const {
    const T thin = p[1] * T(0.5);
    s.bodies = {
        {BodyKind::kRigid, {T(mass), zero<T>(), {thin, T(0.0), T(0.0), p[1], T(0.0), thin}}}};
    s.gravity = {T(slope), T(0.0), T(-kGravity)};
    s.applied[0].torque.y = T(RollingDisc::torque(at.time));
    const Vec3<T> axle{T(0.0), T(1.0), T(0.0)};
    append_rows(WheelContact<T>{zero<T>(), axle, p[0]}, "contact", {0}, s.states, s.rows);
    append_rows(RollingWheel<T>{zero<T>(), axle, p[0]}, "rolling", {0}, s.states, s.rows);
  }
};

/// p: place of the blade, inertia about the vertical.
struct Blade {
  double mass;
  template <class T>
  void operator()(const BodySample& at, const VecX<T>& p, ConstrainedSystem<T>& s) const {
    s.bodies = {
        {BodyKind::kRigid, {T(mass), zero<T>(), {p[1], T(0.0), T(0.0), p[1], T(0.0), p[1]}}}};
    s.gravity = zero<T>();
    s.applied[0].torque.z = T(Sleigh::torque(at.time));
    append_rows(Skate<T>{{-p[0], T(0.0), T(0.0)}, {T(0.0), T(1.0), T(0.0)}}, "blade", {0}, s.states,
                s.rows);
  }
};

/// Places of the hinge in both bodies and the second mass; along the axis, y, only the difference
/// of both places is seen.
struct Pair {
  template <class T>
  void operator()(const BodySample&, const VecX<T>& p, ConstrainedSystem<T>& s) const {
    const auto rigid = [](const T& m, double x, double y, double z) {
      return FreeBody<T>{BodyKind::kRigid,
                         {m, zero<T>(), {T(x), T(0.0), T(0.0), T(y), T(0.0), T(z)}}};
    };
    s.bodies = {rigid(T(1.0), 0.01, 0.02, 0.015), rigid(p[5], 0.006, 0.008, 0.007)};
    const Mat3<T> to_axis = {
        {{T(1.0), T(0.0), T(0.0)}, {T(0.0), T(0.0), T(-1.0)}, {T(0.0), T(1.0), T(0.0)}}};
    append_rows(
        Hinge<T>{{to_axis, {p[0], T(HingedPair{}.p_AJ.y), p[1]}}, {to_axis, {p[2], p[3], p[4]}}},
        "hinge", {0, 1}, s.states, s.rows);
  }
};

}  // namespace

TEST_CASE("constrained loss: lengths and mass of a double pendulum", "[identify][constraints]") {
  const DoublePendulum truth;
  const auto path = path_of(truth, 4.0);
  const ConstrainedModel model(Rods{truth.first_mass});
  Coverage coverage;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const ConstrainedFit fit =
        fit_constrained(model, kRods, smooth_bodies(seen_particles(path, seed)));
    CAPTURE(seed, fit.p.transpose(), fit.covariance.diagonal().cwiseSqrt().transpose());
    CHECK(fit.converged);
    CHECK(std::sqrt(fit.covariance(0, 0)) < 1e-3);  // [m]
    CHECK(std::sqrt(fit.covariance(1, 1)) < 1e-3);
    CHECK(std::sqrt(fit.covariance(2, 2)) < 0.02);  // [kg]
    coverage.add(fit, {truth.first, truth.second, truth.second_mass});
  }
  CAPTURE(coverage.worst());
  CHECK(coverage.share() > kLeastShare);
}

TEST_CASE("constrained loss: radius and inertia of a wheel that rolls", "[identify][constraints]") {
  const RollingDisc truth;
  const auto path = path_of(truth, 8.0);
  const ConstrainedModel model(Roller{truth.slope, truth.mass});
  Coverage coverage;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const ConstrainedFit fit = fit_constrained(
        model, {{"radius", "m", 0.1, Sign::kPositive}, {"axial", "kg*m^2", 0.01, Sign::kPositive}},
        smooth_bodies(seen(path, seed)));
    CAPTURE(seed, fit.p.transpose(), fit.covariance.diagonal().cwiseSqrt().transpose());
    CHECK(fit.converged);
    CHECK(std::sqrt(fit.covariance(0, 0)) < 1e-3);  // [m]
    CHECK(std::sqrt(fit.covariance(1, 1)) < 2e-3);  // [kg·m²]
    coverage.add(fit, {truth.radius, truth.axial});
  }
  CAPTURE(coverage.worst());
  CHECK(coverage.share() > kLeastShare);
}

TEST_CASE("constrained loss: where a sleigh has its blade", "[identify][constraints]") {
  const Sleigh truth;
  const auto path = path_of(truth, 8.0);
  const ConstrainedModel model(Blade{truth.mass});
  Coverage coverage;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const ConstrainedFit fit =
        fit_constrained(model, {{"behind", "m", 0.0}, {"inertia", "kg*m^2", 0.1, Sign::kPositive}},
                        smooth_bodies(seen(path, seed)));
    CAPTURE(seed, fit.p.transpose(), fit.covariance.diagonal().cwiseSqrt().transpose());
    CHECK(fit.converged);
    CHECK(std::sqrt(fit.covariance(0, 0)) < 3e-3);  // [m]
    CHECK(std::sqrt(fit.covariance(1, 1)) < 3e-3);  // [kg·m²]
    coverage.add(fit, {truth.behind, truth.inertia});
  }
  CAPTURE(coverage.worst());
  CHECK(coverage.share() > kLeastShare);
}

TEST_CASE("constrained loss: where two bodies are hinged, and what the second weighs",
          "[identify][constraints]") {
  const HingedPair truth;
  const auto path = path_of(truth, 1.5);
  const ConstrainedModel model(Pair{});
  const std::vector<double> expected{truth.p_AJ.x, truth.p_AJ.z, truth.p_BJ.x,
                                     truth.p_BJ.y, truth.p_BJ.z, truth.second_mass};
  Coverage coverage;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const ConstrainedFit fit = fit_constrained(model,
                                               {{"A.x", "m", 0.1},
                                                {"A.z", "m", 0.0},
                                                {"B.x", "m", -0.1},
                                                {"B.y", "m", 0.0},
                                                {"B.z", "m", 0.0},
                                                {"B.mass", "kg", 1.0, Sign::kPositive}},
                                               smooth_bodies(seen(path, seed)));
    CAPTURE(seed, fit.p.transpose(), fit.covariance.diagonal().cwiseSqrt().transpose());
    CHECK(fit.converged);
    for (int k = 0; k < 5; ++k) CHECK(std::sqrt(fit.covariance(k, k)) < 2e-3);  // [m]
    CHECK(std::sqrt(fit.covariance(5, 5)) < 0.1);                               // [kg]
    coverage.add(fit, expected);
  }
  CAPTURE(coverage.worst());
  CHECK(coverage.share() > kLeastShare);
}

TEST_CASE("constrained loss: what a motion does not tell is infinite", "[identify][constraints]") {
  // Two masses under weight alone show their ratio.
  const DoublePendulum truth;
  const auto masses = []<class T>(const BodySample&, const VecX<T>& p, ConstrainedSystem<T>& s) {
    s.bodies = {particle(p[0]), particle(p[1])};
    append_rows(Rod<T>{zero<T>(), zero<T>(), p[2]}, "upper", {kWorld, 0}, s.states, s.rows);
    append_rows(Rod<T>{zero<T>(), zero<T>(), T(DoublePendulum{}.second)}, "lower", {0, 1}, s.states,
                s.rows);
  };
  const ConstrainedFit fit = fit_constrained(ConstrainedModel(masses),
                                             {{"first", "kg", 1.0, Sign::kPositive},
                                              {"second", "kg", 1.0, Sign::kPositive},
                                              {"length", "m", 0.4, Sign::kPositive}},
                                             smooth_bodies(seen_particles(path_of(truth, 4.0), 1)));
  CHECK(std::isinf(fit.covariance(0, 0)));
  CHECK(std::isinf(fit.covariance(1, 1)));
  CHECK(std::sqrt(fit.covariance(2, 2)) < 1e-3);
  CHECK_THAT(fit.p[1] / fit.p[0], WithinRel(truth.second_mass / truth.first_mass, 0.05));
  REQUIRE(fit.constraints.size() == 2);
  CHECK(fit.constraints[0].name == "upper");
  for (const ConstraintError& c : fit.constraints) CHECK_THAT(c.over_noise, WithinAbs(1.0, 0.2));
}

TEST_CASE("constrained loss: outliers lose weight", "[identify][constraints]") {
  const DoublePendulum truth;
  std::vector<PosedRow> rows = seen_particles(path_of(truth, 8.0), 3);
  for (std::size_t k = 40; k < rows.size(); k += 160) rows[k].X_WB[1].p.x += 0.05;
  const ConstrainedFit fit =
      fit_constrained(ConstrainedModel(Rods{truth.first_mass}), kRods, smooth_bodies(rows));
  CAPTURE(fit.p.transpose());
  CHECK_THAT(fit.p[0], WithinAbs(truth.first, 1e-3));
  CHECK_THAT(fit.p[1], WithinAbs(truth.second, 1e-3));
  // One row in 160 is 50 mm off, 50 times the noise: 8 % of the mass is left of it.
  CHECK_THAT(fit.p[2], WithinRel(truth.second_mass, 0.1));
}

TEST_CASE("constrained loss: a constraint that cannot hold is named", "[identify][constraints]") {
  const DoublePendulum truth;
  const BodyMotion motion = smooth_bodies(seen_particles(path_of(truth, 4.0), 1));
  const auto wrong = []<class T>(const BodySample&, const VecX<T>& p, ConstrainedSystem<T>& s) {
    s.bodies = {particle(T(0.4)), particle(p[0])};
    append_rows(Rod<T>{zero<T>(), zero<T>(), T(0.5)}, "upper", {kWorld, 0}, s.states, s.rows);
    append_rows(Rod<T>{zero<T>(), zero<T>(), T(0.53)}, "another", {kWorld, 0}, s.states, s.rows);
  };
  // (0.53² − 0.5²)/(2 · 0.5) = 30.9 mm.
  CHECK_THROWS_WITH(
      fit_constrained(ConstrainedModel(wrong), {{"mass", "kg", 1.0, Sign::kPositive}}, motion),
      ContainsSubstring("'another'") && ContainsSubstring("contradicts 'upper'") &&
          ContainsSubstring("a posture 3") && ContainsSubstring("mm off"));
  BodyMotion short_one = motion;
  short_one.samples.resize(20);
  CHECK_THROWS_WITH(fit_constrained(ConstrainedModel(Rods{0.4}), kRods, short_one),
                    ContainsSubstring("20 samples") && ContainsSubstring("at least 30"));
  BodyMotion silent = motion;
  silent.noise[1] = {};
  CHECK_THROWS_WITH(fit_constrained(ConstrainedModel(Rods{0.4}), kRods, silent),
                    ContainsSubstring("body 1") && ContainsSubstring("expected more than 0"));
}

TEST_CASE("smoothed bodies: states and accelerations of a known motion", "[identify]") {
  // About its own axis and along a line: ω = (0, 0, w), x = r sin(u t).
  std::vector<PosedRow> rows;
  const double w = 3.0, u = 4.0, r = 0.3;
  const Vec3<double> axis{0.6, 0.0, 0.8};
  for (int k = 0; k < 400; ++k) {
    const double t = k / kFrameRate;
    rows.push_back(
        {t, k / 200, {{exp(axis * (w * t + 0.2 * t * t)), {r * std::sin(u * t), 0, 0}}}});
  }
  const BodyMotion motion = smooth_bodies(rows);
  const std::size_t centres = 400 - 4 * static_cast<std::size_t>(motion.half_width);
  CHECK(motion.samples.size() <= centres);
  CHECK(10 * motion.samples.size() > 8 * centres);  // without those that are fast beside others
  for (const BodySample& s : motion.samples) {
    const double t = s.time;
    CAPTURE(t);
    const BodyState<double>& at = s.states[0];
    CHECK_THAT(dot(at.V.angular, axis), WithinAbs(w + 0.4 * t, kExact));
    CHECK_THAT(dot(s.accelerations[0].angular, axis), WithinAbs(0.4, kExact));
    const Vec3<double> v = at.X_WB.R * at.V.linear;
    const Vec3<double> a =
        at.X_WB.R * (s.accelerations[0].linear + cross(at.V.angular, at.V.linear));
    CHECK_THAT(v.x, WithinAbs(r * u * std::cos(u * t), kExact));
    CHECK_THAT(a.x, WithinAbs(-r * u * u * std::sin(u * t), 1e2 * kExact));
  }
}

}  // namespace constrained_loss_test
