#include "ball_evidence.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace hidden {
namespace {

constexpr double kWindow = 2.0;  // [s]
// Finite differences: large against the spring's transient, small against the motion.
constexpr double kMove = 1e-4, kPush = 1e-3;  // [m], [m/s]
// What is known before: without it, a state along a taut string, which changes nothing, would count
// with the differences' rounding.
constexpr double kStatePrior[2] = {0.1, 1.0};  // [m], [m/s]
constexpr double kStringPrior = 1.0;           // [m]

/// A world in which nothing hides, and one parameter of it moved.
struct Column {
  BallWorld world;
  double step = 1.0;    ///< the change of the parameter
  bool camera = false;  ///< the path is the same
};

class Windows {
 public:
  /// @param truth  the world of the run
  Windows(const BallWorld& truth, const BallRun& run, double sigma)
      : truth_(truth), run_(run), sigma_(sigma) {}

  long count() const {
    return std::max<long>(1, run_.rows * run_.every / std::lround(kWindow / kSwingStep));
  }
  long rows() const { return run_.rows / count(); }

  /// Positions of one window over σ, from its true first state moved by `by` along `axis` (0–5).
  Eigen::VectorXd positions(const BallWorld& world, long window, int axis = 0,
                            double by = 0.0) const {
    const long begin = first_step(window), steps = rows() * run_.every;
    const Hand* hand = &run_.hand[static_cast<std::size_t>(2 * begin)];
    BallState state = settled(world, *hand, run_.path[static_cast<std::size_t>(begin)]);
    (axis < 3 ? state.x[axis] : state.v[axis - 3]) += by;
    return view(world, swing(world, hand, steps, state), 0);
  }
  /// What another camera makes of the true path.
  Eigen::VectorXd recorded(const BallWorld& world, long window) const {
    return view(world, run_.path, first_step(window));
  }

 private:
  long first_step(long window) const { return run_.first + window * rows() * run_.every; }
  Eigen::VectorXd view(const BallWorld& world, const std::vector<BallState>& path,
                       long begin) const {
    Eigen::VectorXd out(3 * rows());
    for (long k = 0; k < rows(); ++k)
      out.segment<3>(3 * k) =
          seen(world, path, static_cast<double>(begin + k * run_.every)) / sigma_;
    return out;
  }

  /// A true state where another string would have it: nothing is to be thrown by a string that is
  /// stretched from the start.
  BallState settled(const BallWorld& world, const Hand& hand, BallState s) const {
    const auto tied = [&](const BallWorld& w) {
      return anchor(hand, w.attachment + w.attachment_off);
    };
    const Anchor there = tied(world), here = tied(truth_);
    const bool same =
        world.length == truth_.length && there.x == here.x && world.compliance == truth_.compliance;
    const double pull = tension(truth_, here, s), length = world.length + give(world) * pull;
    const double distance = (s.x - there.x).norm();
    if (same || (pull <= 0.0 && distance <= length)) return s;
    const Eigen::Vector3d u = (s.x - there.x) / distance;
    s.x = there.x + length * u;
    s.v -= u * u.dot(s.v - there.v);
    return s;
  }

  const BallWorld& truth_;
  const BallRun& run_;
  double sigma_;
};

/// Without the columns that `out` says: N_aa − N_ab N_bb⁻¹ N_ba.
double left_of(const Eigen::MatrixXd& N, int a, const std::vector<int>& out) {
  const auto n = static_cast<Eigen::Index>(out.size());
  if (n == 0) return N(a, a);
  Eigen::MatrixXd B(n, n);
  Eigen::VectorXd b(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    b[i] = N(a, out[static_cast<std::size_t>(i)]);
    for (Eigen::Index k = 0; k < n; ++k)
      B(i, k) = N(out[static_cast<std::size_t>(i)], out[static_cast<std::size_t>(k)]);
  }
  return N(a, a) - b.dot(B.ldlt().solve(b));
}

}  // namespace

BallEvidence ball_evidence(const BallWorld& world, const std::string& effect, bool refit,
                           double sigma, const BallRun& run) {
  const std::vector<BallEffect> all = ball_effects(world);
  const BallEffect& hidden = *std::ranges::find(all, effect, &BallEffect::name);
  BallWorld quiet = world;
  for (const BallParameter& p : hidden.parameters) p.at(quiet) = 0.0;

  // Column 0 is the effect in its true size, then the string, then the rivals.
  std::vector<Column> columns{{world, 1.0, hidden.where == "camera"}};
  std::vector<int> base;
  for (int k = 0; refit && k < 4; ++k) {
    Column c{quiet, kMove, false};
    (k == 0 ? c.world.length : c.world.attachment[k - 1]) += kMove;
    base.push_back(static_cast<int>(columns.size()));
    columns.push_back(c);
  }
  std::vector<std::vector<int>> rival_columns;
  for (const BallEffect& e : all) {
    rival_columns.emplace_back();
    if (e.name == effect || (refit && e.name == "attachment_offset")) continue;
    for (const BallParameter& p : e.parameters) {
      Column c{quiet, 0.1 * e.unit, e.where == "camera"};
      p.at(c.world) = c.step;
      rival_columns.back().push_back(static_cast<int>(columns.size()));
      columns.push_back(c);
    }
  }

  const auto n = static_cast<Eigen::Index>(columns.size());
  const Windows windows(world, run, sigma);
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(n, n);
  BallEvidence out;
  for (long w = 0; w < windows.count(); ++w) {
    const Eigen::VectorXd still = windows.positions(quiet, w), told = windows.recorded(quiet, w);
    Eigen::MatrixXd G(still.size(), n), S(still.size(), 6);
    for (Eigen::Index c = 0; c < n; ++c) {
      const Column& column = columns[static_cast<std::size_t>(c)];
      G.col(c) = (column.camera ? windows.recorded(column.world, w) - told
                                : windows.positions(column.world, w) - still) /
                 column.step;
    }
    for (int k = 0; k < 6; ++k) {
      const double by = k < 3 ? kMove : kPush;
      S.col(k) = (windows.positions(quiet, w, k, by) - windows.positions(quiet, w, k, -by)) /
                 (2.0 * by) * kStatePrior[k / 3];
    }
    out.raw_lm += G.col(0).squaredNorm();
    const Eigen::MatrixXd SG = S.transpose() * G;
    N += G.transpose() * G -
         SG.transpose() * (S.transpose() * S + Eigen::MatrixXd::Identity(6, 6)).ldlt().solve(SG);
  }
  for (const int c : base) N(c, c) += 1.0 / (kStringPrior * kStringPrior);
  for (const std::vector<int>& mine : rival_columns)
    for (const int c : mine) N(c, c) *= 1.0 + 1e-9;
  out.expected_lm = std::max(0.0, left_of(N, 0, base));
  out.visible_share = std::sqrt(out.expected_lm / out.raw_lm);
  for (std::size_t e = 0; e < all.size(); ++e) {
    if (rival_columns[e].empty()) continue;
    std::vector<int> without = base;
    without.insert(without.end(), rival_columns[e].begin(), rival_columns[e].end());
    out.rivals.push_back({all[e].name, std::max(0.0, left_of(N, 0, without))});
  }
  return out;
}

}  // namespace hidden
