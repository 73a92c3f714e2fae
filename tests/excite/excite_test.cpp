#include <algorithm>
#include <cmath>

#include <Eigen/SVD>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/excite/design.hpp>
#include <diffnea/io/model_file.hpp>

#include "excite/cma_es.hpp"
#include "excite/motion.hpp"

namespace diffnea::excite_test {
namespace {

Model model_of(const std::string& file) { return read_model(DIFFNEA_SOURCE_DIR "/models/" + file); }

/// The model's torque along a trajectory; joints that it does not name rest at zero.
RowMatX<double> torque_along(const Model& model, const Trajectory& t) {
  const long n = static_cast<long>(moving_links(model).size());
  RowMatX<double> q = RowMatX<double>::Zero(t.rows(), n), qd = q, qdd = q;
  for (int c = 0; c < t.num_joints(); ++c) {
    const int j = find_joint(model, t.joint_names[static_cast<std::size_t>(c)]);
    q.col(j) = t.q.col(c);
    qd.col(j) = t.qd.col(c);
    qdd.col(j) = t.qdd.col(c);
  }
  return inverse_dynamics(extend(model), q, qd, qdd);
}

/// log det of the information that inertias, rotors, viscous and dry friction share, in the
/// subspace that random states excite: a computation apart from the design's own.
class Judge {
 public:
  Judge(const Model& model, const Trajectory& like) : model_(model), tree_(make_tree(model)) {
    Rng rng(99);
    Trajectory states = like;
    states.time = VecX<double>::LinSpaced(300, 0.0, 1.0);
    for (RowMatX<double>* x : {&states.q, &states.qd, &states.qdd}) {
      x->resize(300, like.num_joints());
      for (double& v : x->reshaped()) v = rng.uniform(-1.0, 1.0);
    }
    const MatX<double> A = columns(states);
    const Eigen::BDCSVD<MatX<double>> svd(A, Eigen::ComputeThinV);
    const VecX<double> s = svd.singularValues();
    const long rank = (s.array() > 1e-9 * s[0]).count();
    basis_ = svd.matrixV().leftCols(rank) * s.head(rank).cwiseInverse().asDiagonal();
  }

  double log_det(const Trajectory& t) const {
    const MatX<double> A = columns(t) * basis_;
    const VecX<double> s =
        Eigen::BDCSVD<MatX<double>>(A / std::sqrt(static_cast<double>(t.rows()))).singularValues();
    return 2.0 * s.array().log().sum();
  }
  long rank() const { return basis_.cols(); }

 private:
  MatX<double> columns(const Trajectory& t) const {
    const long n = tree_.num_dofs(), step = std::max(1L, t.rows() / 400);
    const long rows = (t.rows() + step - 1) / step;
    MatX<double> out = MatX<double>::Zero(rows * n, 10 * n + 3 * n);
    RegressorWorkspace<double, double> ws;
    for (long i = 0; i < rows; ++i) {
      const VecX<double> q = t.q.row(i * step), qd = t.qd.row(i * step), qdd = t.qdd.row(i * step);
      out.block(i * n, 0, n, 10 * n) = torque_regressor<double, double>(tree_, q, qd, qdd, ws);
      for (long j = 0; j < n; ++j) {
        const ModelLink& link =
            model_
                .links[static_cast<std::size_t>(moving_links(model_)[static_cast<std::size_t>(j)])];
        out(i * n + j, 10 * n + j) = qdd[j];
        out(i * n + j, 11 * n + j) = qd[j];
        out(i * n + j, 12 * n + j) = std::tanh(qd[j] / 0.01);
        out.row(i * n + j) /= link.limits.effort;
      }
    }
    return out;
  }

  const Model& model_;
  Tree<double> tree_;
  MatX<double> basis_;
};

}  // namespace

TEST_CASE("excite: between its samples a Fourier series stays below the bound of Ehlich and Zeller",
          "[excite]") {
  const int harmonics = GENERATE(3, 5, 12);
  const long count = GENERATE(5L, 20L) * harmonics;
  CAPTURE(harmonics, count);
  const HarmonicTable coarse(harmonics, count), fine(harmonics, 64 * count);
  Rng rng(7);
  double nearest = 0.0;  // of the bound, over the trials
  for (int trial = 0; trial < 200; ++trial) {
    FourierMotion m{1.0, VecX<double>::Constant(1, rng.normal()), MatX<double>(1, harmonics),
                    MatX<double>(1, harmonics)};
    for (double& v : m.a.reshaped()) v = rng.normal();
    for (double& v : m.b.reshaped()) v = rng.normal();
    const double samples = coarse.sample(m).q.cwiseAbs().maxCoeff(),
                 truth = fine.sample(m).q.cwiseAbs().maxCoeff();
    CHECK(truth <= samples * coarse.overshoot());
    nearest = std::max(nearest, (truth / samples - 1.0) / (coarse.overshoot() - 1.0));
  }
  CHECK(nearest > 0.1);  // no bound that nothing comes near
}

TEST_CASE("excite: the search by samples finds the bottom of a narrow valley", "[excite]") {
  Rng rng(3);
  const auto valley = [](const VecX<double>& x) {  // Rosenbrock's function
    double sum = 0.0;
    for (long i = 0; i + 1 < x.size(); ++i)
      sum += 100.0 * std::pow(x[i + 1] - x[i] * x[i], 2) + std::pow(1.0 - x[i], 2);
    return sum;
  };
  const CmaResult r =
      minimise_by_samples(valley, VecX<double>::Zero(8),
                          {.step = 0.5, .generations = 1500, .least_step = 1e-8}, rng, nullptr);
  constexpr double kTol = 1e-6;  // the search stops at steps of 1e-8
  CHECK(r.value < kTol * kTol);
  CHECK((r.x - VecX<double>::Ones(8)).cwiseAbs().maxCoeff() < kTol);
}

TEST_CASE("excite: limits hold on rows ten times finer, at rest, periodic, the same for a seed",
          "[excite]") {
  const std::string file =
      GENERATE("wam4.xml", "panda.urdf", "emps.urdf", "cart_pole.xml", "furuta.xml");
  CAPTURE(file);
  const Model model = model_of(file);
  DesignOptions o;
  o.iterations = 15;
  o.motion.seed = 3;
  o.motion.duration = 10.0;
  o.motion.rate = 2000.0;
  o.limits.acceleration[""] = 4.0;
  const Excitation fine = design_excitation(model, o);
  o.motion.rate = 200.0;
  const Excitation coarse = design_excitation(model, o);
  const Trajectory& t = fine.trajectory;
  REQUIRE(t.rows() == 20001);
  for (long i = 0; i <= 2000; ++i)  // the rate is no part of the design
    REQUIRE((coarse.trajectory.q.row(i) - t.q.row(10 * i)).cwiseAbs().maxCoeff() < 1e-12);
  CHECK(design_excitation(model, o).trajectory.q == coarse.trajectory.q);
  o.motion.seed = 4;
  CHECK((design_excitation(model, o).trajectory.q - coarse.trajectory.q).cwiseAbs().maxCoeff() >
        0.01);

  const RowMatX<double> torque = torque_along(model, t);
  double closest = 0.0;
  for (int c = 0; c < t.num_joints(); ++c) {
    const int j = find_joint(model, t.joint_names[static_cast<std::size_t>(c)]);
    const ModelLink& link =
        model.links[static_cast<std::size_t>(moving_links(model)[static_cast<std::size_t>(j)])];
    const LimitUse& use = fine.limits[static_cast<std::size_t>(c)];
    CAPTURE(link.joint);
    CHECK(use.joint == link.joint);
    CHECK(t.q.col(c).minCoeff() >= link.limits.lower);
    CHECK(t.q.col(c).maxCoeff() <= link.limits.upper);
    CHECK(t.qd.col(c).cwiseAbs().maxCoeff() <= o.motion.velocity_share * link.limits.velocity);
    CHECK(t.qdd.col(c).cwiseAbs().maxCoeff() <= 4.0);
    const double effort = o.motion.effort_share * link.limits.effort;
    CHECK(torque.col(j).cwiseAbs().maxCoeff() <= effort);
    if (std::isfinite(effort)) {
      // What is said of the torque is what an independent evaluation finds, and its margin small.
      CHECK(use.effort >= torque.col(j).cwiseAbs().maxCoeff() / effort);
      CHECK(use.effort <= 1.02 * torque.col(j).cwiseAbs().maxCoeff() / effort);
    }
    for (const double share : {use.position, use.velocity, use.acceleration, use.effort})
      CHECK(share <= 1.0 + 1e-9);
    closest = std::max({closest, use.position, use.velocity, use.acceleration, use.effort});
  }
  CHECK(closest > 0.9);  // limits are used
  constexpr double kRest = 1e-9;
  for (const long row : {0L, 20000L}) {
    CHECK(t.qd.row(row).cwiseAbs().maxCoeff() < kRest);
    CHECK(t.qdd.row(row).cwiseAbs().maxCoeff() < kRest);
  }
}

TEST_CASE("excite: the design knows more than the median of random motions", "[excite]") {
  const std::string file = GENERATE("wam4.xml", "double_pendulum.urdf");
  CAPTURE(file);
  Model model = model_of(file);
  for (ModelLink& link : model.links)  // one unit of noise for all
    if (!std::isfinite(link.limits.effort) || link.limits.effort <= 0.0) link.limits.effort = 50.0;
  DesignOptions o;
  o.motion.seed = 1;
  o.motion.duration = 10.0;
  o.iterations = 150;
  const Excitation e = design_excitation(model, o);
  const Judge judge(model, e.trajectory);
  std::vector<double> random;
  for (std::uint64_t seed = 0; seed < 15; ++seed) {
    FourierOptions f = o.motion;
    f.seed = seed;
    random.push_back(judge.log_det(random_fourier(model, f)));
  }
  std::ranges::sort(random);
  const double by_judge = std::exp((random[7] - judge.log_det(e.trajectory)) /
                                   (2.0 * static_cast<double>(judge.rank())));
  CAPTURE(by_judge, e.std_ratio, e.random_condition);
  CHECK(by_judge < 0.75);  // standard errors, geometric mean
  CHECK(e.std_ratio < 0.75);
  CHECK(e.best_std_ratio <= e.std_ratio);
  CHECK(e.worst_std_ratio >= e.std_ratio);
  CHECK(e.condition < e.random_condition);
}

TEST_CASE("excite: what cannot be met is refused, with the joint and the limit", "[excite]") {
  using Catch::Matchers::ContainsSubstring;
  const Model wam = model_of("wam4.xml");
  const std::vector<std::string> names = joint_names(wam);
  DesignOptions o;
  o.iterations = 2;
  o.starts = 5;
  o.limits.effort[names[1]] = 0.5;           // [N·m], the shoulder carries the arm
  o.limits.position[names[1]] = {1.4, 1.7};  // level
  CHECK_THROWS_WITH(design_excitation(wam, o), ContainsSubstring("joint '" + names[1] + "'") &&
                                                   ContainsSubstring("0.5") &&
                                                   ContainsSubstring("raise the torque limit"));
  o.limits = {};
  o.limits.velocity["elbw"] = 1.0;
  CHECK_THROWS_WITH(design_excitation(wam, o), ContainsSubstring("elbw"));
  o.limits = {};
  o.limits.acceleration[""] = -1.0;
  CHECK_THROWS_WITH(design_excitation(wam, o), ContainsSubstring("limit of -1 for all joints"));
  o.limits = {};
  o.limits.position[names[0]] = {1.0, -1.0};
  CHECK_THROWS_WITH(design_excitation(wam, o), ContainsSubstring("inverted"));
  o.limits = {};
  o.motion.harmonics = 2;
  CHECK_THROWS_WITH(design_excitation(wam, o), ContainsSubstring("3 or more"));
  o.motion = {};
  o.motion.rate = 1.0;
  CHECK_THROWS_WITH(design_excitation(wam, o), ContainsSubstring("raise it above 2 Hz"));
}

TEST_CASE("excite: limits given replace the model's, and what is asked to stop stops", "[excite]") {
  const Model wam = model_of("wam4.xml");
  DesignOptions o;
  o.motion.duration = 10.0;
  o.limits.velocity[""] = 0.4;  // [rad/s]
  o.limits.position[joint_names(wam)[0]] = {0.1, 0.3};
  int generations = 0;
  o.progress = [&](const FitProgress&) { return ++generations < 4; };
  const Excitation e = design_excitation(wam, o);
  CHECK(e.interrupted);
  CHECK(e.iterations == 4);
  CHECK(e.trajectory.qd.cwiseAbs().maxCoeff() <= 0.4);
  CHECK(e.trajectory.qd.cwiseAbs().maxCoeff() > 0.3);
  CHECK(e.trajectory.q.col(0).minCoeff() >= 0.1);
  CHECK(e.trajectory.q.col(0).maxCoeff() <= 0.3);
}

TEST_CASE("excite: limits given beyond the model's are warned of", "[excite]") {
  Model wam = model_of("wam4.xml");
  const std::string joint = joint_names(wam)[0];
  JointLimits& limits = wam.links[moving_links(wam)[0]].limits;
  const auto warned = [&](double low, double high) {
    DesignOptions o;
    o.motion.duration = 10.0;
    o.iterations = 0;
    o.limits.position[joint] = {low, high};
    const std::vector<std::string> notes = design_excitation(wam, o).notes;
    return std::ranges::any_of(
        notes, [&](const std::string& n) { return n.starts_with("WARNING: " + joint); });
  };
  CHECK_FALSE(warned(limits.lower, limits.upper));
  CHECK(warned(limits.lower, limits.upper + 0.1));
  CHECK(warned(limits.lower - 0.1, limits.upper));
  limits.lower = -std::numeric_limits<double>::infinity();
  limits.upper = std::numeric_limits<double>::infinity();
  CHECK_FALSE(warned(-1.0, 1.0));
}

}  // namespace diffnea::excite_test
