#include "identify/ball_flags.hpp"

#include <algorithm>
#include <cmath>

#include "core/statistics.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

constexpr double kFar = 10.0;     ///< times the usual error
constexpr double kMostFar = 0.1;  ///< share of rows
constexpr double kMostOfWindow = 0.3;
constexpr double kRange = 4.0;    ///< that a window's own C_M may be off the common one by
constexpr double kCertain = 3.0;  ///< standard errors
constexpr std::size_t kEnoughWindows = 10;  ///< windows that tell C_M
constexpr double kChance = 3.7;             ///< standard normal of a probability of 1e-4

/// Which errors are of stretches of at most `most` far ones.
std::vector<bool> short_stretches(const std::vector<double>& errors, double limit,
                                  std::size_t most) {
  std::vector<bool> out(errors.size(), false);
  for (std::size_t k = 0; k < errors.size();) {
    std::size_t end = k;
    while (end < errors.size() && !(errors[end] <= limit)) ++end;
    if (end - k <= most)
      std::fill(out.begin() + static_cast<long>(k), out.begin() + static_cast<long>(end), true);
    k = end + 1;
  }
  return out;
}

}  // namespace

bool drop_far_rows(const FittedBall& ball, BallData& data, const FlightOptions& flight,
                   std::size_t most_on_end) {
  std::vector<std::vector<double>> errors;
  std::vector<double> all;
  for (const BallWindow& w : ball.data.windows) {
    const std::vector<Vec3<double>> seen =
        predict_ball(ball.model, ball.layout, ball.p, ball.data, w, flight);
    errors.emplace_back();
    for (std::size_t k = 0; k < seen.size(); ++k) {
      const Vec3<double> e = w.seen[k] - seen[k];
      errors.back().push_back(std::sqrt(dot(e, e)));
      all.push_back(errors.back().back());
    }
  }
  const double limit =
      kFar / 1.5 * median(all);  // of a normal error in space, the median is 1.54 σ
  for (std::vector<double>& of_window : errors) {
    const std::vector<bool> short_enough = short_stretches(of_window, limit, most_on_end);
    for (std::size_t k = 0; k < of_window.size(); ++k)
      if (!(of_window[k] <= limit) && !short_enough[k]) of_window[k] = 0.0;  // stays
  }
  long far = 0;
  for (const std::vector<double>& of_window : errors)
    far += std::ranges::count_if(of_window, [&](double e) { return !(e <= limit); });
  if (far == 0 || static_cast<double>(far) > kMostFar * static_cast<double>(all.size()))
    return false;
  std::vector<BallWindow> kept;
  for (std::size_t i = 0; i < data.windows.size(); ++i) {
    const BallWindow& w = data.windows[i];
    const auto bad = std::ranges::count_if(errors[i], [&](double e) { return !(e <= limit); });
    if (static_cast<double>(bad) > kMostOfWindow * static_cast<double>(w.time.size())) {
      data.flagged.push_back(
          {w.run, w.time.front(), "ball",
           "is on no path of the model for " + format_number(w.time.back() - w.time.front()) +
               " s (off by up to " + format_number(1e3 * *std::ranges::max_element(errors[i])) +
               " mm)"});
      continue;
    }
    BallWindow cleaned = w;
    cleaned.time.clear();
    cleaned.seen.clear();
    for (std::size_t k = 0; k < w.time.size(); ++k) {
      if (errors[i][k] <= limit) {
        cleaned.time.push_back(w.time[k]);
        cleaned.seen.push_back(w.seen[k]);
      } else {
        data.flagged.push_back({w.run, w.time[k], "ball",
                                "is " + format_number(1e3 * errors[i][k]) + " mm off its path"});
      }
    }
    // A first row that is left out takes the initial state along.
    if (bad == 0 || cleaned.time.front() == w.time.front()) {
      kept.push_back(std::move(cleaned));
    } else if (cleaned.time.size() >= 6) {
      const double late = cleaned.time.front() - w.time.front();
      cleaned.state.x = cleaned.state.x + cleaned.state.v * late;
      kept.push_back(std::move(cleaned));
    }
  }
  data.windows = std::move(kept);
  return true;
}

bool drop_false_spins(const FittedBall& ball, BallData& data, double sigma,
                      const BallFitOptions& options, double& agreed) {
  std::vector<EffectSpec> effects;
  for (const BoundEffect& e : ball.layout.effects) effects.push_back(to_spec(e));
  const bool lifted = std::ranges::any_of(
      effects, [](const EffectSpec& e) { return find_effect(e.effect).has(Trait::kNeedsSpin); });
  if (!lifted) effects.push_back({"magnus", "ball", {}});
  BallLayout layout = make_ball_layout(ball.model, effects);
  VecX<double> p = layout.values();
  p.head(ball.p.size()) = ball.p;
  double present = 0.0;
  for (std::size_t k = 0; k < layout.parameters.size(); ++k) {
    BallParameter& q = layout.parameters[k];
    q.fixed = q.effect < 0 ||
              !layout.effects[static_cast<std::size_t>(q.effect)].info().has(Trait::kNeedsSpin);
    if (!q.fixed) present = p[static_cast<Eigen::Index>(k)];
  }
  BallFitOptions plain = options;
  plain.robust = false;
  BallData one = ball.data;
  struct Own {
    double value, std;
  };
  std::vector<Own> own;
  std::vector<double> told;
  for (const BallWindow& w : ball.data.windows) {
    one.windows.assign(1, w);
    const BallLinearisation at = linearise_ball(ball.model, layout, p, one, sigma, plain);
    const double R = at.R(0, 0);
    own.push_back(
        {R != 0.0 ? present + at.d[0] / R : 0.0, R != 0.0 ? 1.0 / std::abs(R) : INFINITY});
    if (std::abs(own.back().value) > kCertain * own.back().std) told.push_back(own.back().value);
  }
  if (agreed == 0.0) {
    if (told.size() < kEnoughWindows) return false;
    const auto up =
        static_cast<double>(std::ranges::count_if(told, [](double c) { return c > 0; }));
    const auto n = static_cast<double>(told.size());
    const double side = up > 0.5 * n ? 1.0 : -1.0;
    if (std::abs(up - 0.5 * n) < kChance * 0.5 * std::sqrt(n)) return false;
    std::erase_if(told, [&](double c) { return side * c < 0.0; });
    agreed = median(told);
  }
  std::vector<BallWindow> kept;
  for (std::size_t i = 0; i < data.windows.size(); ++i) {
    const double ratio = own[i].value / agreed, std = own[i].std / std::abs(agreed);
    if (ratio < 1.0 / kRange - kCertain * std || ratio > kRange + kCertain * std) {
      const BallWindow& w = data.windows[i];
      data.flagged.push_back({w.run, w.time.front(), "spin",
                              "of " + format_number(std::sqrt(dot(w.spin, w.spin))) +
                                  " rad/s is contradicted by the flight, which shows " +
                                  format_number(ratio) + " times its lift"});
    } else {
      kept.push_back(data.windows[i]);
    }
  }
  if (kept.size() == data.windows.size()) return false;
  data.windows = std::move(kept);
  return true;
}

}  // namespace diffnea
