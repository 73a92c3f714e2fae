#include "identify/ball_path.hpp"

#include <cmath>
#include <limits>

#include "core/constants.hpp"
#include "identify/ball_rows.hpp"
#include "identify/ball_world.hpp"

namespace diffnea {
namespace {

BallSeries::Point point(const Vec3<double>& v) { return {v.x, v.y, v.z}; }

}  // namespace

FittedBall fit_states(const FittedBall& ball, const BallData& data, const BallFitOptions& options) {
  FittedBall out{ball.model, ball.layout, ball.p, data};
  for (std::size_t k = 0; k < out.layout.parameters.size(); ++k) {
    out.layout.parameters[k].fixed = true;
    out.layout.parameters[k].value = ball.p[static_cast<Eigen::Index>(k)];
  }
  fit_ball(out.model, out.layout, out.data, options);
  return out;
}

Model apply_ball(const Model& model, const BallLayout& layout, const VecX<double>& p) {
  Model out = model;
  std::vector<BoundEffect> effects = layout.effects;
  for (std::size_t k = 0; k < layout.parameters.size(); ++k) {
    const BallParameter& parameter = layout.parameters[k];
    const double value = p[static_cast<Eigen::Index>(k)];
    if (parameter.effect >= 0) {
      effects[static_cast<std::size_t>(parameter.effect)]
          .parameters[static_cast<std::size_t>(parameter.index)] = value;
      continue;
    }
    StringSpec& s = *out.ball->string;
    (parameter.index == 0   ? s.length
     : parameter.index == 1 ? s.p_LS.x
     : parameter.index == 2 ? s.p_LS.y
                            : s.p_LS.z) = value;
  }
  for (const BoundEffect& e : effects) {
    const EffectSpec spec = to_spec(e);
    std::erase_if(out.effects, [&](const EffectSpec& s) {
      return s.effect == spec.effect && s.where == spec.where;
    });
    out.effects.push_back(spec);
  }
  return out;
}

double camera_noise(const BallData& data, double longest_gap) {
  std::vector<double> time;
  std::vector<Vec3<double>> seen;
  for (const BallWindow& w : data.windows) {
    time.insert(time.end(), w.time.begin(), w.time.end());
    seen.insert(seen.end(), w.seen.begin(), w.seen.end());
  }
  return camera_noise(time, seen, longest_gap);
}

double path_spread(const BallData& data) {
  Vec3<double> sum{0, 0, 0};
  double squares = 0.0, n = 0.0;
  for (const BallWindow& w : data.windows)
    for (const Vec3<double>& x : w.seen) {
      sum = sum + x;
      squares += dot(x, x);
      n += 1.0;
    }
  return std::sqrt(std::max(0.0, squares / n - dot(sum, sum) / (n * n)) / 3.0);
}

double path_rms(const FittedBall& ball, const FlightOptions& flight) {
  double sum = 0.0;
  long count = 0;
  for (const BallWindow& w : ball.data.windows) {
    const std::vector<Vec3<double>> seen =
        predict_ball(ball.model, ball.layout, ball.p, ball.data, w, flight);
    for (std::size_t k = 0; k < seen.size(); ++k) {
      const Vec3<double> e = w.seen[k] - seen[k];
      sum += dot(e, e);
    }
    count += 3 * static_cast<long>(seen.size());
  }
  return std::sqrt(sum / static_cast<double>(std::max(1L, count)));
}

BallSeries make_ball_series(const FittedBall& base, const FittedBall& extended,
                            const FlightOptions& flight) {
  BallSeries out;
  out.has_string = extended.model.ball->string.has_value();
  out.base_rms = path_rms(base, flight);
  out.extended_rms = path_rms(extended, flight);
  out.flagged = extended.data.flagged;
  for (std::size_t i = 0; i < extended.data.windows.size(); ++i) {
    const BallWindow& w = extended.data.windows[i];
    const std::vector<Vec3<double>> before =
        predict_ball(base.model, base.layout, base.p, base.data, base.data.windows[i], flight);
    const HandMotion& hand = extended.data.hands[static_cast<std::size_t>(w.hand)];
    const BallWorld<double> world(extended.model, extended.layout, hand,
                                  {extended.p.begin(), extended.p.end()});
    out.length = world.r;
    fly(world, w, w.state, flight,
        [&](std::size_t k, const Vec3<double>& seen,
            const BallFlight<double, BallWorld<double>>& f) {
          out.run.push_back(w.run);
          out.window.push_back(static_cast<int>(i));
          out.time.push_back(w.time[k]);
          out.measured.push_back(point(w.seen[k]));
          out.base.push_back(point(before[k]));
          out.extended.push_back(point(seen));
          out.anchor.push_back(out.has_string ? point(world.anchor(w.time[k]).x)
                                              : BallSeries::Point{kNaN, kNaN, kNaN});
          out.taut.push_back(f.taut());
        });
  }
  return out;
}

}  // namespace diffnea
