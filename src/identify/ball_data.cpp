#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/ball_fit.hpp>

namespace diffnea {
namespace {

double norm(const Vec3<double>& v) { return std::sqrt(dot(v, v)); }

Vec3<double> row(const RowMatX<double>& x, long k) { return {x(k, 0), x(k, 1), x(k, 2)}; }
bool is_seen(const Recording& r, long k) { return r.ball.row(k).array().isFinite().all(); }

/// Position and velocity at the first row: the parabola of least squares through 0.1 s of rows.
ParticleState<double> first_state(const BallWindow& w) {
  long n = 0;
  while (n < static_cast<long>(w.time.size()) && (n < 5 || w.time[n] - w.time[0] <= 0.1)) ++n;
  MatX<double> A(n, 3), y(n, 3);
  for (long k = 0; k < n; ++k) {
    const double t = w.time[k] - w.time[0];
    A.row(k) << 1.0, t, t * t;
    y.row(k) << w.seen[k].x, w.seen[k].y, w.seen[k].z;
  }
  const MatX<double> c = A.colPivHouseholderQr().solve(y);
  return {row(RowMatX<double>(c), 0), row(RowMatX<double>(c), 1)};
}

/// Stretches of rows at which the ball is seen, cut to the window's length.
void add_windows(const Recording& r, int hand, const HandMotion& motion,
                 const BallFitOptions& options, BallData& data) {
  BallWindow w;
  RowMatX<double> spin_sum = RowMatX<double>::Zero(1, 3);
  const auto close = [&] {
    if (w.time.size() >= 5 && w.time.back() - w.time.front() >= options.shortest) {
      w.run = r.run;
      w.hand = hand;
      w.state = first_state(w);
      if (r.spin.size() > 0) w.spin = row(spin_sum / static_cast<double>(w.time.size()), 0);
      data.windows.push_back(w);
    }
    w = {};
    spin_sum.setZero();
  };
  for (long k = 0; k < r.rows(); ++k) {
    if (!is_seen(r, k) || !motion.covers(r.time[k], r.time[k])) continue;
    if (!w.time.empty() && (r.time[k] - w.time.back() > options.longest_gap ||
                            r.time[k] - w.time.front() >= options.window))
      close();
    w.time.push_back(r.time[k]);
    w.seen.push_back(row(r.ball, k));
    if (r.spin.size() > 0 && r.spin.row(k).array().isFinite().all()) spin_sum += r.spin.row(k);
  }
  close();
}

}  // namespace

BallData make_ball_data(const Model& model, const std::vector<Recording>& recordings,
                        const BallFitOptions& options) {
  BallData data;
  const TreeMap map = map_to_tree(model);
  const int link = model.ball && model.ball->string ? model.ball->string->link : -1;
  const bool driven = link >= 0 && map.dof[static_cast<std::size_t>(link)] >= 0;
  for (const Recording& r : recordings) {
    if (r.ball.rows() != r.rows() || r.rows() == 0)
      throw DataError(r.source +
                      ": the ball was not recorded; expected columns ball_x, ball_y, "
                      "ball_z [m] in the world's frame");
    const std::size_t before = data.windows.size();
    if (!driven) {
      const Pose<double> X_WL =
          link >= 0 ? map.X_LF[static_cast<std::size_t>(link)] : Pose<double>::identity();
      data.hands.emplace_back(X_WL);
      add_windows(r, static_cast<int>(data.hands.size()) - 1, data.hands.back(), options, data);
    } else {
      const Preprocessed smooth = preprocess(r, plan_preprocess({r}));
      for (long first = 0; first < smooth.rows();) {
        long end = first;
        while (end < smooth.rows() && smooth.segment[end] == smooth.segment[first]) ++end;
        data.hands.emplace_back(model, link, smooth, first, end - first);
        add_windows(r, static_cast<int>(data.hands.size()) - 1, data.hands.back(), options, data);
        first = end;
      }
    }
    if (data.windows.size() == before)
      throw DataError(r.source + ": the ball is nowhere seen for " +
                      std::to_string(options.shortest) + " s on end (rows further apart than " +
                      std::to_string(options.longest_gap) + " s count as a gap)");
  }
  return data;
}

void guess_string(const BallData& data, Vec3<double>& p_LS, double& length) {
  struct Sighting {
    AnchorMotion<double> at0;
    const HandMotion* hand;
    double time;
    Vec3<double> seen;
  };
  std::vector<Sighting> all;
  for (const BallWindow& w : data.windows)
    for (std::size_t k = 0; k < w.time.size(); ++k)
      all.push_back({{}, &data.hands[static_cast<std::size_t>(w.hand)], w.time[k], w.seen[k]});
  const auto distance = [&](const Sighting& s) {
    return norm(s.seen - s.hand->anchor(s.time, p_LS).x);
  };
  std::vector<double> distances;
  const auto quantile = [&](double share) {
    distances.clear();
    for (const Sighting& s : all) distances.push_back(distance(s));
    auto at = distances.begin() + static_cast<std::ptrdiff_t>(share * (distances.size() - 1.0));
    std::nth_element(distances.begin(), at, distances.end());
    return *at;
  };
  double r = quantile(0.8);
  // What the hand's rotations do not show of the attachment stays: 1 mm of a row counts as 10 cm.
  const Vec3<double> start = p_LS;
  for (int round = 0; round < 30; ++round) {
    Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
    Eigen::Vector4d g = Eigen::Vector4d::Zero();
    for (const Sighting& s : all) {
      const Vec3<double> delta = s.seen - s.hand->anchor(s.time, p_LS).x;
      const double d = norm(delta), e = d - r;
      if (d < 0.95 * r) continue;
      const Vec3<double> zero{0, 0, 0}, unit[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
      Eigen::Vector4d J;  // of r − d
      J[0] = 1.0;
      const Vec3<double> origin = s.hand->anchor(s.time, zero).x;
      for (int k = 0; k < 3; ++k)
        J[k + 1] = dot(delta, s.hand->anchor(s.time, unit[k]).x - origin) / d;
      const double w = std::min(1.0, 0.01 / std::max(1e-9, std::abs(e)));
      H += w * J * J.transpose();
      g += w * J * e;
    }
    const double ridge = 1e-4;
    const Vec3<double> moved = p_LS - start;
    H.diagonal().tail<3>().array() += ridge;
    g.tail<3>() -= ridge * to_eigen(moved);
    const Eigen::Vector4d step = H.ldlt().solve(g);
    r += step[0];
    p_LS = p_LS + Vec3<double>{step[1], step[2], step[3]};
    if (step.norm() < 1e-9) break;
  }
  const auto taut = std::ranges::count_if(
      all, [&](const Sighting& s) { return std::abs(distance(s) - r) < 0.02 * r; });
  const double largest = quantile(1.0);
  if (!(r > 0.0) ||
      taut < std::max<std::ptrdiff_t>(20, static_cast<std::ptrdiff_t>(all.size() / 20)))
    throw DataError(
        "the string is nowhere taut: the ball's distance from where it is tied never "
        "stays at one value (the largest is " +
        std::to_string(largest) +
        " m); length and attachment cannot be identified from this recording");
  length = r;
}

}  // namespace diffnea
