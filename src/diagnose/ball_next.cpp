#include "diagnose/ball_next.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/excite/fourier.hpp>

#include "core/decompositions.hpp"
#include "diagnose/next_experiment.hpp"
#include "diagnose/thresholds.hpp"
#include "identify/ball_world.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

constexpr int kBallDraws = 3;      ///< of each family
constexpr double kCamera = 100.0;  ///< rows a second

/// A kind of motion.
struct BallFamily {
  const char* words;
  double period;
  int harmonics;
  double speed;  ///< of the velocity limit
};
constexpr std::array<BallFamily, 5> kBallFamilies{{
    {"slowly, over its whole range", 20.0, 3, 0.3},
    {"in five harmonics up to 0.5 Hz", 10.0, 5, 0.6},
    {"in five harmonics up to 0.5 Hz, at full speed", 10.0, 5, 1.0},
    {"in eight harmonics up to 0.8 Hz", 10.0, 8, 0.5},
    {"in eight harmonics up to 1.3 Hz", 6.0, 8, 0.5},
}};

/// The ball's path along a motion, from hanging at rest on.
BallData imagine(const BallSolution& best, const Trajectory& t) {
  Recording r = imaginary_recording(t);
  r.ball = RowMatX<double>::Constant(t.rows(), 3, std::numeric_limits<double>::quiet_NaN());
  const long every = std::max(
      1L, std::lround(static_cast<double>(t.rows() - 1) / (t.time[t.rows() - 1] * kCamera)));
  for (long k = 0; k < t.rows(); k += every) r.ball.row(k).setZero();
  const BallFitOptions options;
  BallData data = make_ball_data(best.ball.model, {r}, options);
  const BallWorld<double> world(best.ball.model, best.ball.layout, data.hands.front(),
                                {best.ball.p.begin(), best.ball.p.end()});
  BallFlight<double, BallWorld<double>> flight(world, options.flight);
  const double late = world.delay(), begin = data.windows.front().time.front() - late;
  const AnchorMotion<double> anchor = world.anchor(begin);
  flight.start(begin, {anchor.x - Vec3<double>{0, 0, world.r}, anchor.v}, true);
  for (BallWindow& w : data.windows)
    for (std::size_t k = 0; k < w.time.size(); ++k) {
      flight.run_until(w.time[k] - late);
      if (k == 0) w.state = flight.state(), w.taut = flight.taut();
      w.seen[k] = world.seen(flight);
    }
  return data;
}

/// Expected ΔBIC of the rival in the cause's place.
double separation(const BallSolution& best, const BallData& data, const EffectSpec& cause,
                  const EffectSpec& rival, double sigma) {
  std::vector<EffectSpec> terms;
  for (const BoundEffect& e : best.ball.layout.effects) terms.push_back(to_spec(e));
  terms.push_back(rival);
  BallLayout layout = make_ball_layout(best.ball.model, terms,
                                       !best.ball.layout.parameters.front().fixed ||
                                           best.ball.layout.parameters.front().effect >= 0);
  VecX<double> p = layout.values();
  p.head(best.ball.p.size()) = best.ball.p;
  std::vector<int> own;  // columns of the cause
  for (std::size_t k = 0, column = 0; k < layout.parameters.size(); ++k) {
    BallParameter& q = layout.parameters[k];
    if (k < best.ball.layout.parameters.size()) q.fixed = best.ball.layout.parameters[k].fixed;
    if (q.fixed) continue;
    if (q.effect >= 0) {
      const BoundEffect& e = layout.effects[q.effect];
      if (e.info().name == cause.effect && e.where == cause.where)
        own.push_back(static_cast<int>(column));
    }
    ++column;
  }
  BallFitOptions options;
  options.robust = false;
  const BallLinearisation at = linearise_ball(best.ball.model, layout, p, data, sigma, options);
  VecX<double> g = VecX<double>::Zero(at.R.rows());
  std::vector<int> others;
  std::vector<int> free;
  for (std::size_t k = 0; k < layout.parameters.size(); ++k)
    if (!layout.parameters[k].fixed) free.push_back(static_cast<int>(k));
  for (int c = 0; c < static_cast<int>(at.R.cols()); ++c)
    if (std::ranges::find(own, c) != own.end())
      g += at.R.col(c) * p[free[c]];
    else
      others.push_back(c);
  const MatX<double> A = at.R(Eigen::all, others);
  return (g - A * A.colPivHouseholderQr().solve(g)).squaredNorm();
}

std::string label(const EffectSpec& e) {
  std::string out = e.effect;
  std::ranges::replace(out, '_', ' ');
  return out;
}

}  // namespace

std::optional<NextExperiment> ball_next_experiment(const BallSolution& best,
                                                   std::span<const Cause> causes, double sigma,
                                                   std::uint64_t seed) {
  const Model& model = best.ball.model;
  if (!model.ball->string || model.ball->string->link < 0 || joint_names(model).empty()) return {};
  std::vector<ExperimentPair> pairs;
  for (const Cause& c : causes)
    for (const Rival& r : c.members)
      pairs.push_back({c.effect, c.where, r.effect, r.where, r.delta_bic, 0.0});
  if (pairs.empty()) return {};
  std::optional<NextExperiment> out;
  for (const BallFamily& family : kBallFamilies)
    for (int draw = 0; draw < kBallDraws; ++draw) {
      FourierOptions options;
      options.duration = kExperiment;
      options.period = family.period;
      options.harmonics = family.harmonics;
      options.velocity_share *= family.speed;
      options.velocity *= family.speed;
      options.seed = seed + static_cast<std::uint64_t>(draw) + 1;
      NextExperiment next;
      try {
        next.motion = random_fourier(model, options);
        const BallData data = imagine(best, next.motion);
        next.pairs = pairs;
        next.expected_delta_bic = INFINITY;
        for (ExperimentPair& p : next.pairs) {
          p.expected_delta_bic =
              separation(best, data, {p.effect, p.where, {}}, {p.rival, p.rival_where, {}}, sigma);
          next.expected_delta_bic = std::min(next.expected_delta_bic, p.expected_delta_bic);
        }
      } catch (const Error&) {  // this motion is not possible
        continue;
      }
      if (out && !(next.expected_delta_bic > out->expected_delta_bic)) continue;
      next.sentence = std::string("Move all joints ") + family.words + " for " +
                      format_number(kExperiment) + " s: ";
      out = std::move(next);
    }
  if (!out) return out;
  std::string told, not_told;
  double least = INFINITY;
  for (const ExperimentPair& p : out->pairs) {
    const bool tells = p.expected_delta_bic > kToldApart;
    std::string& words = tells ? told : not_told;
    words += (words.empty() ? "" : ", ") + label({p.effect, p.where, {}}) + " from " +
             label({p.rival, p.rival_where, {}});
    if (tells) least = std::min(least, p.expected_delta_bic);
  }
  if (told.empty()) {
    out->sentence = "No motion of the hand that was tried tells " + not_told + ".";
    out->motion = {};
    return out;
  }
  out->expected_delta_bic = least;
  out->trajectory = kNextExperimentFile;
  out->sentence += "that tells " + told + " (expected ΔBIC " + format_number(least) + " or more)" +
                   (not_told.empty() ? "" : "; it does not tell " + not_told) + ".";
  return out;
}

}  // namespace diffnea
