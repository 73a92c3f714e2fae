#include "diagnose/ball_witness.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/QR>

#include "diagnose/ball_search.hpp"
#include "identify/ball_world.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

constexpr double kAccept = 10.0;
constexpr double kFastest = 5.0;  ///< of a period in time [Hz]
constexpr int kMostPeriods = 400;

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

/// 1, cos and sin of one frequency [Hz], and both times the time in the window (the second
/// number): what a force near the swing's own frequency leaves beside a window's initial state.
MatX<double> period(const std::vector<Vec3<double>>& time, double hz) {
  MatX<double> out(static_cast<Eigen::Index>(time.size()), 5);
  for (std::size_t k = 0; k < time.size(); ++k) {
    const double phase = 2.0 * M_PI * hz * time[k].x, c = std::cos(phase), s = std::sin(phase);
    out.row(static_cast<Eigen::Index>(k)) << 1, c, s, time[k].y * c, time[k].y * s;
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
  std::vector<Vec3<double>> errors, clock;
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
          clock.push_back({w.time[k], w.time[k] - 0.5 * (w.time.front() + w.time.back()), 0});
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
  const double total = e.squaredNorm();
  std::vector<Witness> out;
  const auto test = [&](const std::vector<std::string>& names, const MatX<double>& A,
                        double tried) {
    const Eigen::ColPivHouseholderQR<MatX<double>> qr(A);
    const RowMatX<double> rest = e - A * qr.solve(e);
    const double left = rest.squaredNorm();
    const double gain = n / correlation({rest}) * std::log(total / std::max(left, 1e-300)) -
                        3.0 * static_cast<double>(qr.rank()) * std::log(n) - 2.0 * std::log(tried);
    return Witness{"ball", names, 1.0 - left / total, gain};
  };
  for (const Group& g : groups) out.push_back(test(g.names, quadratics(g.values), 1.0));
  // Something that comes and goes by the clock: the best of periods that share a recording's time.
  double first = INFINITY, last = -INFINITY;
  for (const Vec3<double>& t : clock) first = std::min(first, t.x), last = std::max(last, t.x);
  const int most =
      static_cast<int>(std::min<double>(kMostPeriods, 2.0 * kFastest * (last - first)));
  Witness best{"ball", {"time"}, 0.0, -INFINITY};
  for (int k = 1; k <= most; ++k) {
    const double hz = 0.5 * k / (last - first);
    Witness w = test({"time, " + format_number(hz) + " Hz"}, period(clock, hz), most);
    if (w.delta_bic > best.delta_bic) best = std::move(w);
  }
  out.push_back(std::move(best));
  std::erase_if(out, [](const Witness& w) { return !(w.delta_bic > kAccept); });
  std::ranges::stable_sort(out, std::ranges::greater{}, &Witness::delta_bic);
  return out;
}

}  // namespace diffnea
