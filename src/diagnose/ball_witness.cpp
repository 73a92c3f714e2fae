#include "diagnose/ball_witness.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/decompositions.hpp"
#include "core/number_text.hpp"
#include "core/statistics.hpp"
#include "diagnose/ball_search.hpp"
#include "diagnose/thresholds.hpp"
#include "identify/ball_world.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

constexpr double kFastest = 5.0;  ///< of a period in time [Hz]
constexpr int kMostPeriods = 400;

/// A window is unlike the others beyond this many times their error (RMS): where nothing is hidden,
/// windows differ by a seventh with a camera's noise and threefold without.
constexpr double kUnlikeOthers = 4.0;
constexpr double kHeldByFew = 0.8;  ///< of the sum of squares
constexpr std::size_t kLeastWindows = 4;
constexpr int kMostListed = 5;

/// A row's variables, grouped.
struct Group {
  std::vector<std::string> names;
  std::vector<Vec3<double>> values;
};

MatX<double> quadratics(const std::vector<Vec3<double>>& x) {
  MatX<double> out(std::ssize(x), 10);
  for (std::size_t k = 0; k < x.size(); ++k) {
    const auto [a, b, c] = std::array{x[k].x, x[k].y, x[k].z};
    out.row(k) << 1, a, b, c, a * a, a * b, a * c, b * b, b * c, c * c;
  }
  return out;
}

/// 1, cos and sin of one frequency [Hz], and both times the time in the window (the second
/// number): what a force near the swing's own frequency leaves beside a window's initial state.
MatX<double> period(const std::vector<Vec3<double>>& time, double hz) {
  MatX<double> out(std::ssize(time), 5);
  for (std::size_t k = 0; k < time.size(); ++k) {
    const double phase = 2.0 * M_PI * hz * time[k].x, c = std::cos(phase), s = std::sin(phase);
    out.row(k) << 1, c, s, time[k].y * c, time[k].y * s;
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
    const HandMotion& hand = ball.data.hands[w.hand];
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
  MatX<double> e(std::ssize(errors), 3);
  for (std::size_t k = 0; k < errors.size(); ++k) e.row(k) << errors[k].x, errors[k].y, errors[k].z;
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
  std::erase_if(out, [](const Witness& w) { return !(w.delta_bic > kToldApart); });
  std::ranges::stable_sort(out, std::ranges::greater{}, &Witness::delta_bic);
  return out;
}

std::string held_by_few_windows(const BallSeries& series) {
  struct Window {
    int run;
    double from, to, sum = 0.0, rows = 0.0;
    double mean() const { return sum / rows; }
  };
  std::vector<Window> windows;
  for (std::size_t k = 0; k < series.time.size(); ++k) {
    const bool next =
        k == 0 || series.run[k] != series.run[k - 1] || series.window[k] != series.window[k - 1];
    if (next) windows.push_back({series.run[k], series.time[k], series.time[k]});
    Window& w = windows.back();
    w.to = series.time[k];
    ++w.rows;
    for (std::size_t c = 0; c < 3; ++c)
      w.sum += std::pow(series.measured[k][c] - series.extended[k][c], 2);
  }
  if (windows.size() < kLeastWindows) return "";
  std::vector<double> means;
  double all = 0.0, few = 0.0, rest = 0.0, rest_rows = 0.0;
  for (const Window& w : windows) means.push_back(w.mean()), all += w.sum;
  if (!std::isfinite(all)) return "";  // the extended model's path was lost on the way
  const double usual = median(means);
  std::string when;
  int count = 0;
  for (const Window& w : windows) {
    if (w.mean() <= kUnlikeOthers * kUnlikeOthers * usual) {
      rest += w.sum;
      rest_rows += w.rows;
      continue;
    }
    few += w.sum;
    if (++count > kMostListed) continue;
    when +=
        (when.empty() ? "" : ", ") + format_number(w.from) + " to " + format_number(w.to) + " s";
    if (windows.back().run > 0) when += " of run " + std::to_string(w.run);
  }
  if (count == 0 || !(few >= kHeldByFew * all)) return "";
  if (count > kMostListed) when += ", …";
  return "ball: " + std::to_string(count) + " of " + std::to_string(windows.size()) + " windows (" +
         when + ") hold " + format_number(std::floor(1000.0 * few / all) / 10.0) +
         " % of what is left, the others fit to " +
         format_number(1e3 * std::sqrt(rest / (3.0 * rest_rows))) +
         " mm: did it, or its string, touch something there?";
}

}  // namespace diffnea
