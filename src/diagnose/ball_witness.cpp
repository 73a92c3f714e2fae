#include "diagnose/ball_witness.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/QR>

#include "identify/ball_world.hpp"

namespace diffnea {
namespace {

constexpr double kAccept = 10.0;
constexpr int kLags = 40;

/// A row's variables, grouped.
struct Group {
  std::vector<std::string> names;
  std::vector<Vec3<double>> values;
};

MatX<double> quadratics(const std::vector<Vec3<double>>& x) {
  MatX<double> out(static_cast<Eigen::Index>(x.size()), 10);
  for (std::size_t k = 0; k < x.size(); ++k) {
    const auto [a, b, c] = std::array{x[k].x, x[k].y, x[k].z};
    out.row(static_cast<Eigen::Index>(k)) << 1, a, b, c, a * a, a * b, a * c, b * b, b * c, c * c;
  }
  return out;
}

/// Rows that count as one (Geyer's initial positive sequence).
double correlation(const MatX<double>& e) {
  const double all = e.squaredNorm();
  double out = 1.0;
  for (int lag = 1; lag <= kLags && lag < e.rows(); ++lag) {
    const double sum =
        (e.topRows(e.rows() - lag).array() * e.bottomRows(e.rows() - lag).array()).sum();
    if (!(sum > 0.0)) break;
    out += 2.0 * sum / all;
  }
  return out;
}

}  // namespace

std::vector<Witness> ball_witnesses(const FittedBall& ball, const BallFitOptions& options) {
  const bool string = ball.model.ball->string.has_value();
  std::vector<Group> groups{
      {{"ball_x", "ball_y", "ball_z"}, {}}, {{"ball velocity"}, {}}, {{"time"}, {}}};
  if (string)
    for (const char* name : {"string direction", "anchor velocity", "string tension"})
      groups.push_back({{name}, {}});
  std::vector<Vec3<double>> errors;
  for (const BallWindow& w : ball.data.windows) {
    const HandMotion& hand = ball.data.hands[static_cast<std::size_t>(w.hand)];
    const BallWorld<double> world(ball.model, ball.layout, hand, {ball.p.begin(), ball.p.end()});
    fly(world, w, w.state, options.flight,
        [&](std::size_t k, const Vec3<double>& seen,
            const BallFlight<double, BallWorld<double>>& flight) {
          errors.push_back(w.seen[k] - seen);
          const BallSample<double> x = flight.sample();
          groups[0].values.push_back(x.ball.x);
          groups[1].values.push_back(x.ball.v);
          groups[2].values.push_back({w.time[k], 0, 0});
          if (!string) return;
          groups[3].values.push_back(x.u);
          groups[4].values.push_back(x.anchor.v);
          groups[5].values.push_back({flight.pull(), 0, 0});
        });
  }
  MatX<double> e(static_cast<Eigen::Index>(errors.size()), 3);
  for (std::size_t k = 0; k < errors.size(); ++k)
    e.row(static_cast<Eigen::Index>(k)) << errors[k].x, errors[k].y, errors[k].z;
  const auto n = static_cast<double>(e.size());
  const double total = e.squaredNorm(), correlated = correlation(e);
  std::vector<Witness> out;
  for (const Group& g : groups) {
    const MatX<double> A = quadratics(g.values);
    const Eigen::ColPivHouseholderQR<MatX<double>> qr(A);
    const double left = (e - A * qr.solve(e)).squaredNorm();
    const double gain = n / correlated * std::log(total / std::max(left, 1e-300)) -
                        3.0 * static_cast<double>(qr.rank()) * std::log(n);
    if (gain > kAccept) out.push_back({"ball", g.names, 1.0 - left / total, gain});
  }
  std::ranges::stable_sort(out, std::ranges::greater{}, &Witness::delta_bic);
  return out;
}

}  // namespace diffnea
